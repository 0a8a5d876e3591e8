// Makes a page ready for paper, every fold open but those of other views, and puts its figures out as files.
"use strict";
(() => {
  const root = document.documentElement;
  if (root.dataset.export) putOut();

  // Every figure as the text of a file of its own.
  function putOut() {
    const text = (place) => place.querySelector(".scene")?.picture() ?? new XMLSerializer().serializeToString(place.querySelector("svg"));
    const list = document.createElement("pre");
    list.id = "figure-files"; list.textContent = JSON.stringify([...document.querySelectorAll("figure")].map(text));
    document.body.append(list);
  }

  let opened = [];
  window.addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open]):not(.view)")];
    for (const fold of opened) fold.open = true;
  });
  window.addEventListener("afterprint", () => { for (const fold of opened) fold.open = false; });
})();
