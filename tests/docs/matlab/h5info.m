% Of what MATLAB tells about a group, the names of its datasets.
function info = h5info(file, path)
  names = h5py(file, path, "[n for n, x in f[path].items() if isinstance(x, h5py.Dataset)]");
  info = struct("Datasets", struct("Name", names));
endfunction
