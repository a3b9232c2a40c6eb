(() => {
  "use strict";
  const page = JSON.parse(document.getElementById("figures").textContent);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const touched = matchMedia("(pointer: coarse)").matches;
  const chosen = page.figures.map(() => 0);
  const cameras = page.figures.map(() => null);
  const ROOM = 58;

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

  // Camera that sees a box with sides `ratio`, with room for its words, as plotly.js projects: 45 deg high.
  const viewed = (camera, ratio, { width, height }, room) => {
    const across = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const unit = (a) => a.map((entry) => entry / Math.hypot(...a));
    const back = unit(["x", "y", "z"].map((name) => camera.eye[name] - camera.center[name]));
    const right = unit(across([0, 0, 1], back));
    const up = across(back, right);
    const signs = [-0.5, 0.5];
    const corners = signs.flatMap((x) => signs.flatMap((y) => signs.map((z) => [x * ratio.x, y * ratio.y, z * ratio.z])));
    const ends = (direction, centre, distance) => {
      const seen = corners.map((corner) => {
        const from = corner.map((entry, k) => entry - centre[k]);
        return dot(from, direction) / (distance - dot(from, back)) / Math.tan(Math.PI / 8);
      });
      return [Math.min(...seen), Math.max(...seen)];
    };
    const farthest = Math.max(...corners.map((corner) => Math.hypot(...corner)));
    const allowed = [Math.max(0.3 * width, width - 2 * room), Math.max(0.3 * height, height - 2 * room)].map((size) => size / height);
    let centre = [0, 0, 0];
    let distance = 4 * farthest;
    for (let step = 0; step < 60; step += 1) {
      const [left, rightmost] = ends(right, centre, distance);
      const [bottom, top] = ends(up, centre, distance);
      const halfway = (a, b) => ((a + b) / 2) * distance * Math.tan(Math.PI / 8);
      centre = centre.map((entry, k) => entry + halfway(left, rightmost) * right[k] + halfway(bottom, top) * up[k]);
      const fills = Math.max((rightmost - left) / 2 / allowed[0], (top - bottom) / 2 / allowed[1]);
      distance = Math.max((distance * (1 + fills)) / 2, 1.6 * farthest);
    }
    const named = (values) => ({ x: values[0], y: values[1], z: values[2] });
    return { ...camera, center: named(centre), eye: named(centre.map((entry, k) => entry + distance * back[k])) };
  };

  const inView = (layout, size) => {
    const scene = layout.scene;
    return { ...layout, scene: { ...scene, camera: viewed(scene.camera, scene.aspectratio, size, ROOM) } };
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

  // As the reader turned the figure, else with all of it in view.
  const asTurned = (number, layout) => {
    const place = placeOf(number);
    const shown = place.layout?.scene?.camera;
    const before = cameras[number];
    const isTurned = shown && before && ["x", "y", "z"].some((name) =>
      Math.abs(shown.eye[name] - before.eye[name]) + Math.abs(shown.center[name] - before.center[name]) > 1e-6);
    if (isTurned) return { ...layout, scene: { ...layout.scene, camera: shown } };
    const found = inView(layout, { width: place.clientWidth, height: place.clientHeight });
    cameras[number] = found.scene.camera;
    return found;
  };

  const plot = async (number) => {
    const figure = page.figures[number];
    const place = placeOf(number);
    if (figure.spatial && !draws) {
      missing(place, "This figure needs WebGL, which this browser does not offer.");
      return;
    }
    const found = drawn(figure, chosen[number], page.palettes[dark.matches ? "dark" : "light"]);
    const layout = figure.spatial ? asTurned(number, found.layout) : found.layout;
    await Plotly.react(place, found.data, layout, {
      responsive: true, displaylogo: false, displayModeBar: touched || place.clientWidth < 480 ? false : "hover",
      modeBarButtons: figure.spatial
        ? [["toImage", "orbitRotation", "pan3d", "resetCameraDefault3d"]]
        : [["toImage", "zoom2d", "pan2d", "resetScale2d"]],
    });
  };

  // A figure that cannot be drawn stops no other.
  const broken = new Set();
  const attempt = (work, failed) => async (number) => {
    if (broken.has(number)) return;
    try {
      await work(number);
    } catch (error) {
      console.error(error);
      failed(number);
    }
  };
  const draw = attempt(plot, (number) => {
    broken.add(number);
    Plotly.purge(placeOf(number));
    missing(placeOf(number), "This figure could not be drawn.");
  });

  const printable = attempt(async (number) => {
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
      const { data, layout: shownLayout } = drawn(figure, choice, page.palettes.light);
      const layout = figure.spatial ? inView(shownLayout, size) : shownLayout;
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
  }, () => {});

  const follow = new ResizeObserver((entries) => {
    for (const { target } of entries) {
      if (!target.data || !target.clientWidth || target.clientWidth === target._fullLayout.width) continue;
      const number = Number(target.id.slice(1));
      Plotly.Plots.resize(target).then(() => page.figures[number].spatial && draw(number));
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
