// What can be seen through must not hide what is in it: a cue within a target, however they are sorted.
setInterval(() => document.querySelectorAll(".nicegui-scene").forEach((element) =>
  window["scene_" + element.id]?.traverse((one) => {
    if (one.material?.transparent) one.material.depthWrite = false;
  })), 250);
