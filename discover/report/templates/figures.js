// Pictures that can be read: values under the pointer, zoom by dragging, curves switched off, data.
for (const svg of document.querySelectorAll("figure svg[data-read]")) {
  const { axes, switched } = JSON.parse(svg.dataset.read);
  const home = svg.viewBox.baseVal, whole = [home.x, home.y, home.width, home.height];
  const figure = svg.closest("figure"), read = document.createElement("div");
  read.className = "soft read";
  figure.querySelector("figcaption").before(read);
  const show = (view) => svg.setAttribute("viewBox", view.join(" "));
  const place = (event) =>
    new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  const value = ([low, high, logarithmic], share) =>
    (logarithmic ? low * (high / low) ** share : low + (high - low) * share).toPrecision(4);
  let from = null;
  svg.addEventListener("pointermove", (event) => {
    const { x, y } = place(event);
    const panel = axes.find(({ box: [left, top, width, height] }) =>
      x >= left && x <= left + width && y >= top && y <= top + height);
    const said = [];
    if (panel?.x) said.push(`across ${value(panel.x, (x - panel.box[0]) / panel.box[2])}`);
    if (panel?.y) said.push(`up ${value(panel.y, 1 - (y - panel.box[1]) / panel.box[3])}`);
    read.textContent = said.join(", ");
  });
  svg.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "mouse") { from = place(event); event.preventDefault(); }
  });
  svg.addEventListener("pointerup", (event) => {
    if (!from) return;
    const to = place(event), width = Math.abs(to.x - from.x), height = Math.abs(to.y - from.y);
    if (Math.max(width, height) > 8) {
      // as wide or as high as was drawn, in the shape of the whole
      const part = Math.max(width / whole[2], height / whole[3]);
      const size = [part * whole[2], part * whole[3]];
      show([(from.x + to.x - size[0]) / 2, (from.y + to.y - size[1]) / 2, ...size]);
    }
    from = null;
  });
  svg.addEventListener("dblclick", () => show(whole));
  if (switched.length > 1) {
    const row = document.createElement("div");
    row.className = "soft switches";
    switched.forEach((name, i) => {
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox";
      box.checked = true;
      box.addEventListener("change", () => {
        for (const curve of svg.querySelectorAll(`[id^="${figure.id}-run${i}-"]`))
          curve.style.display = box.checked ? "" : "none";
      });
      label.append(box, ` ${name}`);
      row.append(label);
    });
    read.before(row);
  }
}
const first = document.querySelector("figure .read");
if (first) first.textContent = "Point at a picture to read values off; drag to zoom; double-click to see the whole.";
for (const link of document.querySelectorAll("a.data")) {
  const name = link.getAttribute("href");
  const kept = [...document.querySelectorAll("script.data")].find((e) => e.dataset.name === name);
  if (kept) link.href = URL.createObjectURL(new Blob([JSON.parse(kept.textContent)]));
  link.download = name;
}
for (const button of document.querySelectorAll("button[data-copy]")) {
  const kept = [...document.querySelectorAll("script.copy")].find((e) => e.dataset.name === button.dataset.copy);
  if (!kept) continue;
  button.addEventListener("click", async () => {
    const text = JSON.parse(kept.textContent), name = button.dataset.copy;
    try { await navigator.clipboard.writeText(text); }
    catch { // a file opened from disk may have no clipboard
      const area = document.createElement("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    button.textContent = "copied";
    setTimeout(() => { button.textContent = name; }, 1500);
  });
}
