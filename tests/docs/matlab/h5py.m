% What an expression of Python's h5py makes of a path in a file.
function value = h5py(file, path, expression)
  program = ["import h5py, json, sys; path = sys.argv[2]; f = h5py.File(sys.argv[1]); print(json.dumps(" expression "))"];
  command = sprintf("%s -c \"%s\" \"%s\" \"%s\"", getenv("PYTHON"), program, file, path);
  [status, printed] = system(command);
  assert(status == 0);
  value = jsondecode(printed);
endfunction
