function study = read_labcrane(folder)
% READ_LABCRANE  Load a whole export of labcrane in one call, in MATLAB and in Octave.
%
%   study = read_labcrane('export')
%   study.trials                  one row per movement, all participants: a table in MATLAB,
%                                 a struct of columns in Octave
%   study.units                   the unit of each of its columns
%   study.questionnaires          one row per answer, all participants
%   study.scores                  one row per score of a questionnaire
%   study.participants(1).name
%   study.participants(1).sessions{1}.streams.state.data.joint_angle_slew
%
% Times are in s, angles in rad, lengths in m; every stream has its units. If a participant lacks a
% column that others have, its numbers are NaN and its texts ''.

if nargin < 1
  folder = fileparts(mfilename('fullpath'));
end
files = sort({dir(fullfile(folder, '*.mat')).name});
if isempty(files)
  error('labcrane:empty', 'there is no .mat file in %s', folder);
end
tables = {'trials', 'questionnaires', 'scores'};
study = struct('units', struct());
for t = 1:numel(tables)
  study.(tables{t}) = struct();
end
for k = 1:numel(files)
  one = load(fullfile(folder, files{k}));
  person = one.labcrane;
  if k == 1
    first = person;
  elseif ~strcmp(person.study, first.study)
    error('labcrane:studies', ...
      '%s is of the study ''%s'' and %s of ''%s''; read each study from a folder of its own', ...
      first.participant, first.study, person.participant, person.study);
  end
  study.participants(k) = struct('name', person.participant, 'status', person.status, ...
    'why', person.why, 'sessions', {person.sessions});
  study.units = join_units(study.units, person.units, person.participant);
  for t = 1:numel(tables)
    study.(tables{t}) = append(study.(tables{t}), person.(tables{t}), person.participant);
  end
end
if ~exist('OCTAVE_VERSION', 'builtin')
  for t = 1:numel(tables)
    study.(tables{t}) = struct2table(study.(tables{t}));
  end
end
end

function units = join_units(units, more, who)
% Add the units of one participant's columns; numbers of different units are not one column.
names = fieldnames(more);
for n = 1:numel(names)
  name = names{n};
  if isfield(units, name) && ~strcmp(units.(name), more.(name))
    error('labcrane:units', ['%s has the column %s in ''%s'' and others have it in ''%s''; ' ...
      'read each study from a folder of its own'], who, name, more.(name), units.(name));
  end
  units.(name) = more.(name);
end
end

function all = append(all, more, who)
% Add the rows of one participant, with missing values where only one side has a column.
above = rows(all);
below = rows(more);
names = [fieldnames(all); fieldnames(rmfield(more, intersect(fieldnames(all), fieldnames(more))))];
for n = 1:numel(names)
  name = names{n};
  [upper, lower] = alike(column(all, name, above), column(more, name, below), name, who);
  all.(name) = [upper; lower];
end
end

function count = rows(table)
names = fieldnames(table);
count = 0;
if ~isempty(names)
  count = numel(table.(names{1}));
end
end

function values = column(table, name, count)
if isfield(table, name)
  values = table.(name);
else
  values = NaN(count, 1);
end
end

function [a, b] = alike(a, b, name, who)
% Return two columns of one type: what is all missing takes the type of the other.
if iscell(a) == iscell(b)
  return
end
if iscell(a)
  [b, a] = alike(b, a, name, who);
elseif all(isnan(a))
  a = repmat({''}, numel(a), 1);
elseif all(cellfun(@isempty, b))
  b = NaN(numel(b), 1);
else
  warning('labcrane:types', ['the column %s is words of some participants and numbers of others, ' ...
    'as %s shows: it is all words here; the study may have been amended between them'], name, who);
  a = arrayfun(@(x) sprintf('%.15g', x), a, 'UniformOutput', false);
  a(strcmp(a, 'NaN')) = {''};
end
end
