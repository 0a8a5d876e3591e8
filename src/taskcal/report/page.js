// Makes a page ready for paper, every fold open but those of other views, and puts its figures out as files.
"use strict";
(() => {
  const root = document.documentElement;
  if (root.dataset.export) putOut(root.dataset.export);

  // Every figure as an address that holds its data, for files of their own.
  async function putOut(format) {
    const figures = [];
    for (const place of document.querySelectorAll("figure")) {
      const scene = place.querySelector(".scene");
      figures.push(scene ? scene.picture(format) : await picture(place.querySelector("svg"), format));
    }
    const list = document.createElement("pre");
    list.id = "figure-files"; list.textContent = JSON.stringify(figures);
    document.body.append(list);
  }
  async function picture(svg, format) {
    const address = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(new XMLSerializer().serializeToString(svg))}`;
    if (format === "svg") return address;
    const image = new Image(), canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
    image.src = address;
    await image.decode();
    canvas.width = 2 * image.width; canvas.height = 2 * image.height;
    pen.fillStyle = "white"; pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(image, 0, 0, canvas.width, canvas.height);
    return canvas.toDataURL("image/png");
  }

  let opened = [];
  window.addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open]):not(.view)")];
    for (const fold of opened) fold.open = true;
  });
  window.addEventListener("afterprint", () => { for (const fold of opened) fold.open = false; });
})();
