function render({ model, el }) {
  const image = document.createElement("img");
  let address = "";
  const show = () => {
    URL.revokeObjectURL(address);
    address = URL.createObjectURL(new Blob([model.get("value")], { type: "image/png" }));
    image.src = address;
  };
  const place = (event) => {
    const frame = image.getBoundingClientRect();
    const [x, y] = [(event.clientX - frame.left) / frame.width, (event.clientY - frame.top) / frame.height];
    const [left, top, right, bottom] = model.get("area");
    return { x, y, width: frame.width, inside: left <= x && x <= right && top <= y && y <= bottom };
  };
  image.className = "widget-image";
  image.style.maxWidth = "none";
  image.style.width = "100%";
  image.alt = model.get("hint");
  image.addEventListener("pointermove", (event) => {
    const { inside } = place(event);
    image.style.cursor = inside ? "pointer" : "";
    image.title = inside ? model.get("hint") : "";
  });
  image.addEventListener("click", (event) => {
    const { x, y, width, inside } = place(event);
    if (inside) model.send({ x, y, width });
  });
  model.on("change:value", show);
  show();
  el.append(image);
  return () => {
    model.off("change:value", show);
    URL.revokeObjectURL(address);
  };
}
export default { render };
