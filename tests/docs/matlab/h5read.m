% A dataset as MATLAB returns it: a column, of cells where it is text.
function values = h5read(file, path)
  values = h5py(file, path, "f[path].asstr()[()].tolist() if f[path].dtype.kind in 'OS' else f[path][()].tolist()");
endfunction
