% An attribute as MATLAB returns it.
function value = h5readatt(file, path, name)
  value = h5py(file, path, ["f[path].attrs['" name "']"]);
endfunction
