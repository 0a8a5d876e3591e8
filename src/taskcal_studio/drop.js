// Files that are dropped or chosen go to the server as they are; their names beside them, as text.
async function taskcalSend(input, files) {
  const said = input.parentElement.querySelector(".said");
  // meshes are kept beside the robot that they were dropped with, which goes first
  const first = (file) => (/\.(stl|obj|dae|glb)$/i.test(file.name) ? 1 : 0);
  let beside = "";
  let sent = 0;
  const large = [...files].find((file) => file.size > Number(input.dataset.most));
  if (large) {
    said.textContent = input.dataset.large.replace("{name}", () => large.name);
    return;
  }
  for (const file of [...files].sort((a, b) => first(a) - first(b))) {
    said.textContent = files.length > 1 ? `${input.dataset.working} ${++sent} / ${files.length}` : input.dataset.working;
    try {
      const answer = await fetch("/drop/" + encodeURIComponent(input.dataset.kind), {
        method: "POST",
        body: file,
        headers: { "content-type": "application/octet-stream", "x-file-name": encodeURIComponent(file.name), "x-beside": encodeURIComponent(beside) },
      });
      if (!answer.ok) {
        const text = await answer.text();
        let message = text;
        try { message = JSON.parse(text).message; } catch { /* a refusal at the gate is plain text */ }
        said.textContent = message;
        return;
      }
      beside = beside || (await answer.json()).path;
    } catch (failure) {
      said.textContent = String(failure.message || failure);
      return;
    }
  }
  location.reload();
}
document.addEventListener("change", (event) => {
  if (event.target.matches?.("label.drop input")) taskcalSend(event.target, event.target.files);
});
for (const kind of ["dragenter", "dragover", "dragleave", "drop"]) {
  document.addEventListener(kind, (event) => {
    const zone = event.target.closest?.("label.drop");
    if (kind === "dragover" || kind === "drop") event.preventDefault(); // a file beside the zone must not replace the page
    if (!zone) return;
    zone.classList.toggle("over", kind === "dragenter" || kind === "dragover");
    if (kind === "drop") taskcalSend(zone.querySelector("input"), event.dataTransfer.files);
  });
}
