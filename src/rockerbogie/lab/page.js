// Runs before viser's own script.
(() => {
  // Browsers give a touch to the element that it begins on. viser takes that for a drag of its own and drops taps on the
  // terrain, so the picture's touches are released.
  addEventListener("pointerdown", (event) => {
    const { target, pointerId, pointerType } = event;
    if (pointerType !== "touch" || !(target instanceof HTMLCanvasElement)) return;
    if (target.hasPointerCapture(pointerId)) target.releasePointerCapture(pointerId);
  }, true);

  // The server reads this item, and chooses light drawing for a browser without a graphics card.
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl && gl.getExtension("WEBGL_debug_renderer_info");
  const renderer = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  const slow = /swiftshader|llvmpipe|software|basic render/i.test(renderer);
  try {
    localStorage.setItem("viser-user:renderer", slow ? "processor" : "card");
  } catch { /* a browser that blocks it has the switch in the tab Terrain */ }
  if (!slow) return;

  // The time of a picture drawn by the processor is proportional to its pixels: no antialiasing, fewer pixels while
  // the scene moves, and no empty background picture.
  const get = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return get.call(this, kind, kind.startsWith("webgl") ? { ...options, antialias: false } : options);
  };
  const SHARP = Math.min(devicePixelRatio, 1), COARSE = 0.4;
  const MOVING = 350, ROW = 6;  // ms and number of pictures in a row from which the scene counts as moving
  const REST = 600;  // ms without a picture from which it counts as at rest
  let watched = null, began = 0, row = 0, last = -Infinity, timer = 0;
  const ratio = (value) => window.__viserTestpoints.devSettings.set({ fixedDpr: value });
  const drawn = () => {
    const now = performance.now();
    if (now - last > REST) [began, row] = [now, 0];
    last = now;
    row += 1;
    if (now - began > MOVING && row >= ROW) ratio(COARSE);
    clearTimeout(timer);
    timer = setTimeout(() => ratio(SHARP), REST);
  };
  setInterval(() => {
    const scene = window.__viserTestpoints && window.__viserMutable && window.__viserMutable.scene;
    // viser's own warning stays until it is closed, and the page has one beside the numbers.
    for (const note of document.querySelectorAll(".mantine-Notification-root")) {
      if (note.textContent.startsWith("Software WebGL")) note.querySelector("button").click();
    }
    if (!scene || scene === watched) return;
    watched = scene;
    scene.onAfterRender = drawn;
    window.__viserMutable.backgroundMaterial.visible = false;
    ratio(SHARP);
  }, 500);
})();
