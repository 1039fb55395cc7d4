// A figure whose curves came along (src/execbook/explore.py) has a button that loads uPlot and them, at the first
// click, and puts a plot to zoom into in the place of the picture. Everything lies on the disk beside the page.
(() => {
  const here = document.currentScript.src.replace(/[^/]*$/, "");
  const loaded = {};
  const load = (url) =>
    (loaded[url] ??= new Promise((done, fail) => {
      const style = url.endsWith(".css");
      const tag = document.createElement(style ? "link" : "script");
      if (style) tag.rel = "stylesheet";
      tag.onload = done;
      tag.onerror = () => fail(new Error(`${url} cannot be loaded`));
      tag[style ? "href" : "src"] = url;
      document.head.append(tag);
    }));
  const make = (kind, properties = {}, ...children) => {
    const node = Object.assign(document.createElement(kind), properties);
    node.append(...children);
    return node;
  };
  const button = (label, title, act) =>
    make("button", { type: "button", textContent: label, title, ariaLabel: title, onclick: act });
  const theme = () => (document.documentElement.dataset.theme === "dark" ? 1 : 0);
  const raised = (n) => String(+n).replace(/[-\d]/g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);
  const text = (value, digits = 4) => {
    if (value == null) return "–";
    const [front, power] = value.toExponential(digits - 1).split("e");
    if (!value || (power >= -3 && power < 6)) return String(+value.toPrecision(digits)).replace("-", "−");
    return `${+front === 1 ? "" : `${+front} × `}10${raised(power)}`.replace("-", "−");
  };

  const powers = (_, __, low, high) => {
    const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
    const step = Math.ceil((last - first) / 8);
    const found = [];
    for (let power = first; power <= last; power += step)
      for (const front of last - first > 3 ? [1] : [1, 2, 5]) found.push(+`${front}e${power}`);
    const inside = found.filter((v) => v >= low && v <= high);
    return inside.length > 1 ? inside : [low, high];
  };

  // One panel: its uPlot for the theme in force, and what it says at an abscissa.
  class Panel {
    constructor(panel, look, key, small) {
      Object.assign(this, { panel, look, key, small, hidden: new Set() });
      this.data = uPlot.join(panel.tables);
      this.readout = make("output", { className: "explore-readout" });
      this.box = make("div", { className: "explore-canvas" });
      const line = (text, className) => make("div", { className, textContent: text });
      this.node = make(
        "div", { className: "explore-panel" }, line(panel.title, "explore-title"), line(panel.ylabel, "explore-label"),
        this.box, line(panel.xlabel, "explore-label explore-across"), this.readout,
      );
    }
    draw() {
      const { panel, look, data } = this;
      const now = theme();
      const kept = this.plot && [this.plot.scales.x.min, this.plot.scales.x.max];
      this.plot?.destroy();
      const axis = (log, more) => ({
        ...(log && { splits: powers, filter: (_, splits) => splits }),
        stroke: look.ink[now], font: "12px system-ui",
        grid: { stroke: look.grid[now], width: 1 }, ticks: { stroke: look.grid[now], width: 1 },
        values: (_, splits) => splits.map((v) => (v == null ? "" : text(v, log ? 3 : 6))), ...more,
      });
      const bands = [];
      for (let k = 0; k < panel.curves.length; k++)
        if (!panel.curves[k].curve) bands.push({ series: [k + 2, ++k], fill: panel.curves[k].colour[now] });
      const few = data[0].length <= 60;
      this.plot = new uPlot(
        {
          width: this.box.clientWidth, height: this.small ? 220 : 340, legend: { show: false }, bands,
          cursor: {
            y: false, drag: { x: true, y: true, uni: 24 }, points: { size: (_, k) => (panel.curves[k - 1].curve ? 7 : 0) },
            sync: { key: this.key, setSeries: false, scales: ["x", null] },
          },
          scales: {
            x: { time: false, distr: panel.log[0] ? 3 : 1, range: (_, low, high) => [low, high] },
            y: panel.log[1] ? { distr: 3, range: (_, low, high) => [(low ?? 1) / 1.3, (high ?? 10) * 1.3] } : {},
          },
          axes: [
            axis(panel.log[0], { size: 32 }),
            axis(panel.log[1], { size: (_, values) => 18 + 7 * Math.max(2, ...(values ?? []).map((v) => v.length)) }),
          ],
          series: [
            {},
            ...panel.curves.map((c) => ({
              label: c.label, stroke: c.colour[now], width: c.curve ? Math.max(1, c.width) : 0, dash: c.dash ?? [],
              show: !this.hidden.has(c.label), points: { show: Boolean(c.curve) && (few || c.dash === null), size: 5, fill: look.paper[now] },
              ...(c.dash === null && { paths: () => null }),
            })),
          ],
          hooks: {
            drawAxes: [(u) => this.across(u, now)],
            setCursor: [(u) => u.cursor.left >= 0 && this.say(u.posToVal(u.cursor.left, "x"))],
          },
        },
        data,
        this.box,
      );
      if (kept) this.plot.setScale("x", { min: kept[0], max: kept[1] });
    }
    across(u, now) {
      for (const { axis, at, colour, dash } of this.panel.levels) {
        const { left, top, width, height } = u.bbox;
        const place = u.valToPos(at, axis, true);
        const flat = axis === "y";
        if (flat ? place < top || place > top + height : place < left || place > left + width) continue;
        u.ctx.save();
        u.ctx.strokeStyle = colour[now];
        u.ctx.setLineDash(dash ?? []);
        u.ctx.beginPath();
        u.ctx.moveTo(flat ? left : place, flat ? place : top);
        u.ctx.lineTo(flat ? left + width : place, flat ? place : top + height);
        u.ctx.stroke();
        u.ctx.restore();
      }
    }
    say(x) {
      const { data, panel } = this;
      const nearest = (column) => {
        let best = -1;
        data[0].forEach((at, k) => {
          if (column[k] != null && (best < 0 || Math.abs(at - x) < Math.abs(data[0][best] - x))) best = k;
        });
        return best;
      };
      const said = panel.curves.flatMap((c, k) => {
        if (!c.curve || !c.label || this.hidden.has(c.label)) return [];
        const at = nearest(data[k + 1]);
        return at < 0 ? [] : [`${c.label.replace(/ \[.*/, "")} ${text(data[k + 1][at])}`];
      });
      const [, what, unit = ""] = panel.xlabel.match(/^(.*?)(?: \[(.*)\])?$/);
      const of = panel.ylabel.match(/\[(.*)\]$/)?.[1] ?? "";
      this.readout.textContent = `${what} ${text(data[0][nearest(data[0])])} ${unit}: ${said.join(", ")} ${of}`;
    }
    zoom(factor, shift) {
      const { min, max } = this.plot.scales.x;
      const [to, from] = this.panel.log[0] ? [Math.log, Math.exp] : [(v) => v, (v) => v];
      const [low, high] = [to(min), to(max)];
      const [centre, half] = [(low + high) / 2 + shift * (high - low), (factor * (high - low)) / 2];
      const first = this.data[0][0];
      const last = this.data[0].at(-1);
      this.plot.setScale("x", { min: Math.max(first, from(centre - half)), max: Math.min(last, from(centre + half)) });
    }
    whole() {
      this.plot.setData(this.data); // the whole of both axes
    }
    show(label, on) {
      this.hidden[on ? "delete" : "add"](label);
      this.panel.curves.forEach((c, k) => c.label === label && this.plot.setSeries(k + 1, { show: on }));
    }
  }

  function build({ panels, look }, name, alt, back) {
    const small = panels.length > 1;
    const drawn = panels.map((panel) => {
      const ends = panel.tables.map(([x]) => [x[0], x.at(-1)]);
      return new Panel(panel, look, `${name} ${panel.xlabel} ${ends[0]}`, small);
    });
    const each = (act) => drawn.forEach(act);
    const labels = new Map(panels.flatMap((p) => p.curves.filter((c) => c.curve && c.label).map((c) => [c.label, c.colour])));
    const swatches = [];
    const legend = [...labels].map(([label, colour]) => {
      const box = make("input", { type: "checkbox", checked: true, onchange: () => each((p) => p.show(label, box.checked)) });
      swatches.push([make("span", { className: "explore-swatch" }), colour]);
      return make("label", {}, box, swatches.at(-1)[0], label);
    });
    const grid = drawn[0].data[0];
    const slider = make("input", { type: "range", min: 0, max: grid.length - 1, step: 1, value: 0 });
    slider.oninput = () => {
      const x = grid[slider.value];
      slider.ariaValueText = text(x);
      each((p) => {
        p.plot.setCursor({ left: p.plot.valToPos(x, "x"), top: 10 }, false);
        p.say(x);
      });
    };
    const thinned = Math.max(...panels.map((p) => p.thinned));
    const note = `Drag to zoom, double click for the whole.${thinned > 1 ? ` One point in ${thinned} is shown.` : ""}`;
    const node = make(
      "div", { className: "explore-box", role: "group", ariaLabel: alt },
      make("div", { className: "explore-bar" }, ...legend),
      make("div", { className: panels.length > 2 ? "explore-panels many" : "explore-panels" }, ...drawn.map((p) => p.node)),
      make("div", { className: "explore-bar" },
        make("label", { className: "explore-slider" }, `${panels[0].xlabel || "place"} `, slider)),
      make("div", { className: "explore-bar" },
        button("+", "Zoom in", () => each((p) => p.zoom(0.5, 0))), button("−", "Zoom out", () => each((p) => p.zoom(2, 0))),
        button("←", "Move to the left", () => each((p) => p.zoom(1, -0.25))),
        button("→", "Move to the right", () => each((p) => p.zoom(1, 0.25))),
        button("Whole", "Show the whole", () => each((p) => p.whole())), button("Picture", "Back to the picture", back)),
      make("small", { textContent: note }),
    );
    const draw = () => {
      swatches.forEach(([swatch, colour]) => (swatch.style.background = colour[theme()]));
      if (node.isConnected && !node.hidden) each((p) => p.draw());
      each((p) => p.say(grid[slider.value]));
    };
    new MutationObserver(draw).observe(document.documentElement, { attributeFilter: ["data-theme"] });
    new ResizeObserver(() => each((p) => {
      const width = p.box.clientWidth;
      if (p.plot && width && width !== p.plot.width) p.plot.setSize({ width, height: p.plot.height });
    })).observe(node);
    return { node, draw, slider };
  }

  function offer(image) {
    const name = decodeURIComponent(image.src).replace(/^.*\/|\.light\d*\.png$/g, "");
    const twins = image.closest(".twins");
    let made;
    const swap = (open) => {
      twins.hidden = start.hidden = open;
      made.node.hidden = !open;
      if (open) made.draw();
      (open ? made.slider : start).focus({ preventScroll: true });
    };
    const start = make("button", { type: "button", className: "explore-start", textContent: "Explore" });
    start.onclick = async () => {
      if (!made) {
        const source = image.src.replace(/\.png$/, ".js");
        await load(source);
        const given = window.exploreData[name];
        const back = () => swap(false);
        if (given.script) {
          await load(here + given.script); // a script of its own, which draws without a library
          made = window.exploreScripts[given.script].build(given, image.alt, back, { make, text, theme, button });
        } else {
          await Promise.all([load(`${here}uplot/uPlot.iife.min.js`), load(`${here}uplot/uPlot.min.css`)]);
          made = build(given, name, image.alt, back);
        }
        twins.after(made.node);
      }
      swap(true);
    };
    twins.after(start);
  }
  window.addEventListener("DOMContentLoaded", () => document.querySelectorAll("img.explore.twin-light").forEach(offer));
})();
