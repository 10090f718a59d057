// A widget of anywidget: a page in a frame of its own, which no style of the notebook reaches.

export default {
  /** @param {{model: any, el: HTMLElement}} widget @returns What ends it. */
  render({ model, el }) {
    const frame = document.createElement("iframe");
    Object.assign(frame, { title: model.get("_title"), srcdoc: model.get("_page"), height: "400" });
    frame.setAttribute("sandbox", "allow-scripts allow-downloads");
    const tell = () => {
      const [r, g, b] = getComputedStyle(el)
        .color.match(/[\d.]+/g)
        .map(Number);
      const dark = r + g + b > 384; // where the notebook's text is light
      frame.style.cssText = `width: 100%; border: 0; color-scheme: ${dark ? "dark" : "light"}`;
      frame.contentWindow?.postMessage({ dark, drawn: model.get("drawn"), moved: model.get("moved") }, "*");
    };
    let heard = null; // what moved in the page, which it need not be told
    const hear = ({ source, data }) => {
      if (source !== frame.contentWindow) return;
      if (data.height) frame.height = data.height;
      heard = data.moved ?? heard;
      for (const name of ["drawn", "moved"]) if (data[name]) model.set(name, data[name]);
      model.save_changes();
    };
    const tellMoved = () => model.get("moved") !== heard && tell();
    const looks = new MutationObserver(tell);
    for (const element of [document.documentElement, document.body]) looks.observe(element, { attributes: true });
    window.addEventListener("message", hear);
    frame.onload = tell;
    model.on("change:drawn", tell);
    model.on("change:moved", tellMoved);
    el.append(frame);
    return () => {
      looks.disconnect();
      window.removeEventListener("message", hear);
      model.off("change:drawn", tell);
      model.off("change:moved", tellMoved);
    };
  },
};
