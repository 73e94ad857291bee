// Says when the server is gone, and loads the page anew once another one answers in its place.
"use strict";
(() => {
  const EVERY_MS = 1500, PATIENCE_MS = 15000; // a machine that compiles kernels answers late
  const GONE =
    "The server has stopped, or cannot be reached. Start iprt view --web again with the same " +
    "--port: this page then goes on by itself.";

  let notice = null;

  function show(text) {
    if (notice === null) {
      notice = document.body.appendChild(document.createElement("div"));
      notice.appendChild(document.createElement("p")).style.maxWidth = "34em";
    }
    notice.id = "iprt-gone";
    notice.setAttribute("role", "alert");
    notice.style.cssText =
      "position:fixed;inset:0;z-index:10000;display:flex;align-items:center;" +
      "justify-content:center;background:#000a;color:#fff;font:16px/1.5 sans-serif;" +
      "padding:2em;text-align:center";
    notice.firstChild.textContent = text;
  }

  async function look() {
    try {
      const signal = AbortSignal.timeout(PATIENCE_MS);
      const answer = await fetch("/alive", { cache: "no-store", signal });
      if (answer.ok) {
        if ((await answer.text()).trim() !== IPRT_RUN) return location.reload();
        notice?.remove();
        notice = null;
      }
    } catch {
      show(GONE);
    }
    setTimeout(look, EVERY_MS);
  }

  window.addEventListener("load", look);
})();
