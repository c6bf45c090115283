% Octave has no tables; MATLAB makes one of columns that are equally long.
function columns = struct2table(columns)
  lengths = structfun(@numel, columns);
  assert(all(lengths == lengths(1)));
endfunction
