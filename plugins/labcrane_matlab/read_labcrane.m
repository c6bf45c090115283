function study = read_labcrane(folder)
% READ_LABCRANE  Load a whole export of labcrane in one call, in MATLAB and in Octave.
%
%   study = read_labcrane('export')
%   study.trials                  one row per movement, all participants: a table in MATLAB,
%                                 a struct of columns in Octave
%   study.units                   the unit of each of its columns
%   study.participants(1).name
%   study.participants(1).sessions{1}.streams.state.data.joint_angle_slew
%
% Times are seconds, angles rad, lengths m; units are beside every stream.

if nargin < 1
  folder = fileparts(mfilename('fullpath'));
end
files = sort({dir(fullfile(folder, '*.mat')).name});
if isempty(files)
  error('labcrane:empty', 'there is no .mat file in %s', folder);
end
columns = struct();
for k = 1:numel(files)
  one = load(fullfile(folder, files{k}));
  person = one.labcrane;
  entry = struct('name', person.participant, 'status', person.status, 'why', person.why);
  entry.sessions = person.sessions;
  study.participants(k) = entry;
  columns = append(columns, person.trials, k == 1);
  if k == 1
    study.units = person.units;
  end
end
if exist('OCTAVE_VERSION', 'builtin')
  study.trials = columns;
else
  study.trials = struct2table(columns);
end
end

function all = append(all, more, first)
% Add the rows of one participant; a column that one of them lacks is an error, not a gap.
if first
  all = more;
  return
end
names = fieldnames(all);
if ~isequal(sort(names), sort(fieldnames(more)))
  error('labcrane:columns', 'participants have different columns; they are different studies');
end
for n = 1:numel(names)
  all.(names{n}) = [all.(names{n}); more.(names{n})];
end
end
