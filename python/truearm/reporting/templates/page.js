(() => {
  "use strict";
  const page = JSON.parse(document.getElementById("figures").textContent);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const touched = matchMedia("(pointer: coarse)").matches;
  const chosen = page.figures.map(() => 0);

  const coloured = (value, palette) => {
    if (typeof value === "string") {
      return (value.startsWith("@") && palette[value.slice(1)]) || value;
    }
    if (Array.isArray(value)) {
      return value.map((entry) => coloured(entry, palette));
    }
    if (value && typeof value === "object") {
      return Object.fromEntries(Object.entries(value).map(([key, entry]) => [key, coloured(entry, palette)]));
    }
    return value;
  };

  const merged = (base, more) => {
    const found = { ...base };
    for (const [key, value] of Object.entries(more)) {
      const isObject = value && typeof value === "object" && !Array.isArray(value);
      found[key] = isObject ? merged(base[key] || {}, value) : value;
    }
    return found;
  };

  const layoutOf = (figure) => {
    const base = { ...page.layout };
    for (const key of Object.keys(figure.layout)) {
      const axis = /^([xy]axis|scene)\d+$/.exec(key);
      if (axis) base[key] = page.layout[axis[1]];
    }
    if (!figure.spatial) delete base.scene;
    if (!figure.spatial && touched) base.dragmode = false;
    return merged(base, figure.layout);
  };

  const drawn = (figure, choice, palette) => {
    const state = figure.choices[choice];
    const traces = figure.traces.map((trace, k) => (state ? { ...trace, visible: state.shown[k] } : trace));
    const layout = state ? merged(layoutOf(figure), state.layout) : layoutOf(figure);
    return { data: coloured(traces, palette), layout: coloured(layout, palette) };
  };

  const hasWebgl = () => Boolean(document.createElement("canvas").getContext("webgl"));
  const draws = page.figures.some((figure) => figure.spatial) ? hasWebgl() : true;
  const pause = () => new Promise((done) => setTimeout(done, 0));
  const placeOf = (number) => document.getElementById(`f${number}`);

  const missing = (place, words) => {
    const text = document.createElement("p");
    text.className = "missing";
    text.textContent = words;
    place.replaceChildren(text);
  };

  const draw = async (number) => {
    const figure = page.figures[number];
    const place = placeOf(number);
    if (figure.spatial && !draws) {
      missing(place, "This figure needs WebGL, which this browser does not offer.");
      return;
    }
    const { data, layout } = drawn(figure, chosen[number], page.palettes[dark.matches ? "dark" : "light"]);
    const camera = place.layout?.scene?.camera;
    if (camera) layout.scene = { ...layout.scene, camera };
    await Plotly.react(place, data, layout, {
      responsive: true, displaylogo: false, displayModeBar: touched || place.clientWidth < 480 ? false : "hover",
      modeBarButtons: figure.spatial
        ? [["toImage", "orbitRotation", "pan3d", "resetCameraDefault3d"]]
        : [["toImage", "zoom2d", "pan2d", "resetScale2d"]],
    });
  };

  const printable = async (number) => {
    const figure = page.figures[number];
    const place = placeOf(number);
    if (figure.spatial && !draws) return;
    const printed = place.parentElement.querySelector(".printed");
    const shown = figure.wide ? Math.max(1, Math.min(2, figure.choices.length)) : 1;
    const alone = figure.wide && shown === 1;
    const size = { width: alone ? 760 : 400, height: Math.min(figure.height, alone ? 460 : 330) };
    const format = figure.spatial ? "png" : "svg";
    const images = [];
    for (let choice = 0; choice < shown; choice += 1) {
      const { data, layout } = drawn(figure, choice, page.palettes.light);
      const source = await Plotly.toImage(
        { data, layout: { ...layout, ...size, autosize: false, paper_bgcolor: "#ffffff" } },
        { format, ...size, scale: figure.spatial ? 2 : 1 },
      );
      const block = document.createElement("div");
      const image = document.createElement("img");
      image.src = source;
      image.alt = "";
      block.append(image);
      if (figure.choices.length) {
        const label = document.createElement("span");
        label.textContent = figure.choices[choice].label;
        block.prepend(label);
      }
      images.push(block);
    }
    printed.replaceChildren(...images);
    place.parentElement.classList.add("ready");
  };

  const follow = new ResizeObserver((entries) => {
    for (const { target } of entries) {
      if (target.data && target.clientWidth && target.clientWidth !== target._fullLayout.width) Plotly.Plots.resize(target);
    }
  });

  const each = async (work) => {
    for (let number = 0; number < page.figures.length; number += 1) {
      await work(number);
      await pause();
    }
  };

  const load = async () => {
    const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  };

  const choose = (button) => {
    const number = Number(button.dataset.figure);
    chosen[number] = Number(button.dataset.choice);
    for (const other of button.parentElement.children) {
      other.setAttribute("aria-pressed", String(other === button));
    }
    draw(number);
  };

  const start = async () => {
    if (typeof DecompressionStream === "undefined") {
      page.figures.forEach((_, number) => missing(placeOf(number), "This browser is too old to draw figures."));
      return;
    }
    await load();
    await each(draw);
    document.querySelectorAll(".plot").forEach((place) => follow.observe(place));
    document.documentElement.dataset.figures = "drawn";
    dark.addEventListener("change", () => each(draw));
    await each(printable);
    document.documentElement.dataset.figures = "printable";
  };

  document.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-figure]");
    if (button && globalThis.Plotly) choose(button);
  });
  start();
})();
