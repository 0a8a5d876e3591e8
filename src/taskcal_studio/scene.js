"use strict";
// What a scene of the cell needs in the browser: the colours of its page, its size, and clicks that are none of a drag.
function taskcalScene(id, gain) {
  const view = getElement(Number(id.slice(1)));
  if (!view.renderer) return; // no WebGL
  const at = [0, 0];
  view.$el.addEventListener("pointerdown", (event) => at.splice(0, 2, event.clientX, event.clientY), true);
  view.$el.addEventListener("click", (event) => {
    if (Math.hypot(event.clientX - at[0], event.clientY - at[1]) > 4) event.stopPropagation();
  }, true);
  for (const part of view.scene.children) if (part.object_id === "ground") part.visible = false; // it would hide what is below
  view.renderer.toneMapping = 1; // linear: nothing but the gain
  const paint = () => {
    view.renderer.toneMappingExposure = document.body.classList.contains("body--dark") ? gain : 1;
    view.renderer.setClearColor(getComputedStyle(document.body).getPropertyValue("--ground").trim());
  };
  new MutationObserver(paint).observe(document.body, { attributes: true, attributeFilter: ["class"] });
  new ResizeObserver(() => view.resize()).observe(view.$el);
  paint();
}

// Shows which row of a part of the page is selected.
function taskcalMark(id, row) {
  const area = document.getElementById(id);
  for (const before of area.querySelectorAll("[data-row][aria-current]")) before.removeAttribute("aria-current");
  for (const now of area.querySelectorAll(`[data-row="${row}"]`)) now.setAttribute("aria-current", "true");
}
