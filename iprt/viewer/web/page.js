// Panorama navigation for viser's page: a drag turns the view with the scene under the cursor, and
// the wheel changes the field of view. The last picture turns with the view until the next one
// arrives, so that gizmos stay on their objects.
//
// It uses the interface of viser's own tests (window.__viserMutable).
"use strict";
(() => {
  const MIN_FOV = 2, MAX_FOV = 150, ZOOM_STEP = 0.9; // as in iprt/viewer/viewport.py
  const KEY_STEP = 0.05; // radians
  const PICTURE = "/picture"; // scene node with the pose of the newest picture; see picture.py
  const AROUND = "/around"; // scene node with the panorama, and its pose in the picture's axes
  const AGAIN_MS = 500; // interval between repeated camera messages

  const fragment = `
    varying vec2 vUv;
    uniform sampler2D colorMap;
    uniform bool enabled;
    uniform bool moved;
    uniform mat3 turn; // rotation from the view to the picture's view
    uniform vec2 extent; // tangents of half the fields of view
    uniform vec2 pictureExtent;
    uniform bool surrounded;
    uniform sampler2D around; // panorama of the video
    uniform mat3 toPanorama; // rotation from the picture's view to the panorama's axes
    void main() {
      if (!enabled) discard;
      vec3 color = texture2D(colorMap, vUv).rgb;
      if (moved) {
        vec3 ray = turn * vec3((2.0 * vUv - 1.0) * extent, -1.0);
        vec2 at = 0.5 + 0.5 * ray.xy / (max(-ray.z, 1e-6) * pictureExtent);
        vec3 d = normalize(toPanorama * ray);
        // As equirect_pixel() in iprt/geometry/equirect.py; the last row is at the bottom.
        vec2 texel = vec2(atan(d.x, -d.z) / 6.28318531 + 0.5, 1.0 - acos(clamp(d.y, -1.0, 1.0)) / 3.14159265);
        bool beside = ray.z >= 0.0 || max(abs(at.x - 0.5), abs(at.y - 0.5)) > 0.5;
        vec3 other = surrounded ? texture2D(around, texel).rgb : vec3(0.0);
        color = beside ? other : texture2D(colorMap, at).rgb;
      }
      gl_FragColor = vec4(color, 1.0);
      #ifdef USE_REVERSED_DEPTH_BUFFER
        gl_FragDepth = 0.0;
      #else
        gl_FragDepth = 1.0;
      #endif
    }`;

  function attach() {
    const viser = window.__viserMutable;
    let mesh = null;
    viser?.scene?.traverse((node) => {
      if (node.material && node.material === viser.backgroundMaterial) mesh = node;
    });
    if (!mesh || !viser.camera || !viser.cameraControl || !viser.canvas) {
      setTimeout(attach, 20);
      return;
    }
    turnPictures(viser, mesh);
    steer(viser);
    // The page may send its camera before it is connected or has its size, and the server would
    // keep rendering for that. Repeat the camera; the server repeats its messages likewise.
    setInterval(() => {
      if (!picture || mesh.material.uniforms.moved.value) viser.sendCamera();
    }, AGAIN_MS);
    window.iprt = { picture: () => picture }; // for tests
  }

  // Reprojection of the last picture ----------------------------------------------------------

  let picture = null; // camera quaternion and tangents of half the fields of view

  function turnPictures(viser, mesh) {
    const material = mesh.material, uniforms = material.uniforms;
    const identity = [1, 0, 0, 0, 1, 0, 0, 0, 1];
    Object.assign(uniforms, {
      moved: { value: false }, turn: { value: identity },
      extent: { value: [1, 1] }, pictureExtent: { value: [1, 1] },
      surrounded: { value: false }, around: { value: null }, toPanorama: { value: identity },
    });
    material.fragmentShader = fragment;
    material.needsUpdate = true;

    // viser sets the texture once it is decoded; the newest pose message belongs to it.
    let texture = uniforms.colorMap.value;
    Object.defineProperty(uniforms.colorMap, "value", {
      get: () => texture,
      set: (next) => {
        texture = next;
        const pose = viser.nodePoseData[PICTURE];
        if (next && pose?.wxyz && pose?.position) {
          const [w, x, y, z] = pose.wxyz;
          // viser's cameras look along +Z, with +Y down; three.js's are rotated about X.
          const half = viser.camera.quaternion.clone().set(1, 0, 0, 0);
          const turned = viser.camera.quaternion.clone().set(x, y, z, w).multiply(half);
          const [aw, ax, ay, az] = viser.nodePoseData[AROUND]?.wxyz ?? [1, 0, 0, 0];
          const toPanorama = columns({ x: ax, y: ay, z: az, w: aw });
          picture = { quaternion: turned, extent: pose.position.slice(0, 2), toPanorama };
        }
      },
    });

    const world = viser.camera.quaternion.clone();
    mesh.onBeforeRender = (_renderer, _scene, camera) => {
      if (!picture) return;
      const high = Math.tan((camera.fov * Math.PI) / 360), wide = high * camera.aspect;
      const root = viser.nodePoseData[""]?.wxyz ?? [1, 0, 0, 0];
      world.set(root[1], root[2], root[3], root[0]);
      const turn = world.multiply(picture.quaternion).invert().multiply(camera.quaternion);
      const same = (a, b) => Math.abs(a / b - 1) < 1e-4;
      const still = Math.hypot(turn.x, turn.y, turn.z) < 1e-5;
      const [pictureWide, pictureHigh] = picture.extent;
      uniforms.moved.value = !(still && same(high, pictureHigh) && same(wide, pictureWide));
      uniforms.around.value = surroundings(viser);
      // At rest the picture may be narrower on purpose.
      uniforms.surrounded.value = !still && uniforms.around.value !== null;
      uniforms.toPanorama.value = picture.toPanorama;
      uniforms.turn.value = columns(turn);
      uniforms.extent.value = [wide, high];
      uniforms.pictureExtent.value = picture.extent;
      material.uniformsNeedUpdate = true;
    };
  }

  // Return the texture of the panorama, which an invisible scene node brings; null before that.
  function surroundings(viser) {
    let texture = null;
    viser.nodeRefFromName[AROUND]?.traverse((node) => (texture ??= node.material?.map ?? null));
    if (texture && texture.colorSpace) {
      Object.assign(texture, { colorSpace: "", wrapS: 1000, generateMipmaps: false, minFilter: 1006 });
      texture.needsUpdate = true;
    }
    return texture;
  }

  function columns({ x, y, z, w }) {
    return [
      1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y),
      2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
      2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y),
    ];
  }

  // Mouse and keys ----------------------------------------------------------------------------

  function steer(viser) {
    // Listen before viser's own handlers: on the window, in the capture phase.
    const listen = (kind, heard) =>
      window.addEventListener(kind, heard, { capture: true, passive: false });

    listen("pointerdown", (event) => {
      if (event.target !== viser.canvas) return;
      const controls = viser.cameraControl;
      // Let the scene follow the cursor; viser's own drag orbits a model in the centre.
      const speed = -Math.tan((viser.camera.fov * Math.PI) / 360) / Math.PI;
      controls.azimuthRotateSpeed = controls.polarRotateSpeed = speed;
      const rotate = controls.mouseButtons.left;
      Object.assign(controls.mouseButtons, { middle: rotate, right: rotate, wheel: 0 });
      Object.assign(controls.touches, { two: 0, three: 0 });
    });

    listen("wheel", (event) => {
      if (event.target !== viser.canvas) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      const lines = [100, 3, 1][event.deltaMode];
      const { camera } = viser;
      const fov = camera.fov * ZOOM_STEP ** (-event.deltaY / lines);
      camera.fov = Math.min(Math.max(fov, MIN_FOV), MAX_FOV);
      camera.updateProjectionMatrix();
      viser.requestRender();
      viser.sendCamera();
    });

    const turns = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const moves = new Set(["KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE"]);
    listen("keydown", (event) => {
      const typing = event.target.closest?.("input, textarea, select, [role=slider], [contenteditable]");
      if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
      // The view never leaves the capture centre.
      if (moves.has(event.code)) event.stopImmediatePropagation();
      const turn = turns[event.code];
      if (!turn || event.target.closest?.("[role]")) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      const share = viser.camera.fov / 60;
      viser.cameraControl.rotate(KEY_STEP * share * turn[0], KEY_STEP * share * turn[1], false);
    });
  }

  // Fix the pixel ratio, which viser would otherwise adapt to the browser's speed.
  const address = new URL(window.location.href);
  address.searchParams.set("fixedDpr", window.devicePixelRatio);
  window.history.replaceState(null, "", address);
  attach();
})();
