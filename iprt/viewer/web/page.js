// Steering of viser's page as in a panorama: a drag turns the view with the scene under the cursor,
// the wheel changes the field of view, and the view never leaves the capture centre.
//
// viser has no public way to do that at once: its own drag orbits a model, and a turn by the server
// would follow the mouse late. So this uses the interface of viser's tests (window.__viserMutable).
"use strict";
(() => {
  const MIN_FOV = 2, MAX_FOV = 150, ZOOM_STEP = 0.9; // as in iprt/viewer/viewport.py
  const KEY_STEP = 0.05; // radians
  const AGAIN_MS = 500; // interval between repeated camera messages

  // Listen before viser's own handlers: on the window, in the capture phase.
  function listen(kind, heard) {
    const once = (event) => window.__viserMutable?.cameraControl && heard(event, window.__viserMutable);
    window.addEventListener(kind, once, { capture: true, passive: false });
  }

  listen("pointerdown", (event, viser) => {
    if (event.target !== viser.canvas) return;
    const controls = viser.cameraControl;
    // Let the scene follow the cursor; viser's own drag orbits a model in the centre.
    const speed = -Math.tan((viser.camera.fov * Math.PI) / 360) / Math.PI;
    controls.azimuthRotateSpeed = controls.polarRotateSpeed = speed;
    const rotate = controls.mouseButtons.left;
    Object.assign(controls.mouseButtons, { middle: rotate, right: rotate, wheel: 0 });
    Object.assign(controls.touches, { two: 0, three: 0 });
  });

  listen("wheel", (event, viser) => {
    if (event.target !== viser.canvas) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    const { camera } = viser;
    const fov = camera.fov * ZOOM_STEP ** (-event.deltaY / [100, 3, 1][event.deltaMode]);
    camera.fov = Math.min(Math.max(fov, MIN_FOV), MAX_FOV);
    camera.updateProjectionMatrix();
    viser.requestRender();
    viser.sendCamera();
  });

  const turns = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  const moves = new Set(["KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE"]);
  listen("keydown", (event, viser) => {
    const typing = event.target.closest?.("input, textarea, select, [role=slider], [contenteditable]");
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    if (moves.has(event.code)) event.stopImmediatePropagation();
    const turn = turns[event.code];
    if (!turn || event.target.closest?.("[role]")) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    const step = (KEY_STEP * viser.camera.fov) / 60;
    viser.cameraControl.rotate(step * turn[0], step * turn[1], false);
  });

  // The page may send its camera before it is connected or has its size, and the server would keep
  // rendering for that. Repeat the camera; the server repeats its messages likewise.
  setInterval(() => window.__viserMutable?.sendCamera?.(), AGAIN_MS);

  // Fix the pixel ratio, which viser would otherwise adapt to the browser's speed.
  const address = new URL(window.location.href);
  address.searchParams.set("fixedDpr", window.devicePixelRatio);
  window.history.replaceState(null, "", address);
})();
