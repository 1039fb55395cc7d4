// The pair on a line, filtered in the browser: sliders for what the filter assumes, on the series that the build drew.
// State [separation, rate]; motion and noise of a step come from the build, the noise for a power density of one.
(() => {
  const times = (A, B) => A.map((row) => B[0].map((_, j) => row.reduce((sum, a, k) => sum + a * B[k][j], 0)));
  const turned = (A) => A[0].map((_, j) => A.map((row) => row[j]));
  const plus = (A, B, factor = 1) => A.map((row, i) => row.map((a, j) => a + factor * B[i][j]));

  // Kalman filter of scalar observations, one after the other, in the Joseph form; the prior is that of the first epoch.
  function filter({ Phi, Q, prior, gnss, rate }, q, sigmaGnss, sigmaRate) {
    let [m, P] = [prior.mean.map((v) => [v]), prior.cov];
    return gnss.map((_, k) => {
      if (k) [m, P] = [times(Phi, m), plus(times(times(Phi, P), turned(Phi)), Q, q)];
      const predicted = { mean: m.flat(), cov: P };
      let nis = 0;
      for (const [i, z, sigma] of [[0, gnss[k], sigmaGnss], [1, rate[k], sigmaRate]]) {
        if (z == null) continue;
        const [y, S] = [z - m[i][0], P[i][i] + sigma ** 2];
        const K = P.map((row) => [row[i] / S]);
        const A = P.map((_, r) => P.map((_, c) => (r === c) - (c === i) * K[r][0]));
        m = plus(m, K, y);
        P = plus(times(times(A, P), turned(A)), times(K, turned(K)), sigma ** 2);
        nis += y ** 2 / S;
      }
      return { predicted, mean: m.flat(), cov: P, nis };
    });
  }

  const SVG = "http://www.w3.org/2000/svg";
  const draw = (parent, kind, attributes, text) => {
    const node = document.createElementNS(SVG, kind);
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    if (text !== undefined) node.textContent = text;
    parent.append(node);
    return node;
  };
  const round = (low, high) => {
    const raw = (high - low) / 5;
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((front) => front * power).find((s) => s >= raw);
    const first = Math.ceil(low / step);
    return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, k) => (first + k) * step);
  };

  // Axes in a box: gives the drawing area and the two scales.
  function axes(box, title, height, [x0, x1, xlabel], [y0, y1, ylabel], { text, yticks, ylog }) {
    const width = box.clientWidth;
    const [left, right, top, bottom] = [52, 8, 24, 40];
    const svg = draw(box, "svg", { width, height, "aria-hidden": true });
    box.replaceChildren(svg);
    const to = ylog ? Math.log10 : (v) => v;
    const px = (x) => left + ((x - x0) / (x1 - x0)) * (width - left - right);
    const py = (y) => height - bottom - ((to(y) - to(y0)) / (to(y1) - to(y0))) * (height - top - bottom);
    const mark = (x, y, anchor, words) =>
      draw(svg, "text", { x, y, "text-anchor": anchor, fill: "currentColor", "font-size": 12 }, words);
    const grid = (x1, y1, x2, y2) => draw(svg, "line", { x1, y1, x2, y2, stroke: "var(--pst-color-border)" });
    for (const x of round(x0, x1)) {
      grid(px(x), top, px(x), height - bottom);
      mark(px(x), height - bottom + 15, "middle", text(x));
    }
    for (const y of yticks ?? round(y0, y1)) {
      grid(left, py(y), width - right, py(y));
      mark(left - 5, py(y) + 4, "end", text(y));
    }
    mark((left + width - right) / 2, height - 5, "middle", xlabel);
    mark(2, 13, "start", `${title}${title && ", "}${ylabel}`);
    const area = draw(svg, "svg", { x: left, y: top, width: Math.max(1, width - left - right), height: height - top - bottom });
    area.setAttribute("viewBox", `${left} ${top} ${Math.max(1, width - left - right)} ${height - top - bottom}`);
    return { area, px, py };
  }
  const path = (points) => `M${points.map((point) => point.map((v) => v.toFixed(2)).join(" ")).join("L")}`;
  const ellipse = ([s, v], P) => {
    const [a, b] = [Math.sqrt(P[0][0]), P[0][1] / Math.sqrt(P[0][0])];
    const c = Math.sqrt(Math.max(0, P[1][1] - b ** 2));
    return Array.from({ length: 73 }, (_, k) => {
      const [x, y] = [2 * Math.cos((k * Math.PI) / 36), 2 * Math.sin((k * Math.PI) / 36)];
      return [s + a * x, v + b * x + c * y];
    });
  };

  function build(given, alt, back, { make, text, theme, button }) {
    const { minutes, truth, gnss, rate, colours, bounds, defaults } = given;
    const slider = (label, unit, low, high, value, power) => {
      const said = make("output");
      const input = make("input", { type: "range", min: low, max: high, step: power ? "any" : 1, value });
      input.now = () => (power ? 10 ** +input.value : +input.value);
      input.tell = (shown) => {
        said.textContent = `${shown} ${unit}`;
        input.ariaValueText = said.textContent;
      };
      input.first = value;
      input.oninput = () => redraw();
      return [make("label", {}, make("span", { textContent: label }), input, said), input];
    };
    const log = (value) => Math.log10(value);
    const [qLabel, q] = slider("process noise q", "m²/s³", log(defaults.q) - 4, log(defaults.q) + 4, log(defaults.q), true);
    const [gLabel, g] = slider("sigma of GNSS", "m", -4, 1, log(defaults.gnss), true);
    const [kLabel, k] = slider("sigma of K-band", "m/s", -8, -1, log(defaults.rate), true);
    const [eLabel, epoch] = slider("epoch of the ellipses", "min", 0, minutes.length - 1, defaults.epoch, false);
    const inputs = [q, g, k, epoch];
    const box = (name) => make("div", { className: `playground-${name}` });
    const [series, before, nis] = [box("series"), box("ellipse"), box("nis")];
    const key = [["truth", "truth"], ["GNSS", "seen"], ["estimate ± two sigma", "estimate"], ["before the update", "before"]];
    const swatches = key.map(([, colour]) => [make("span", { className: "explore-swatch" }), colour]);
    const told = make("output", { className: "explore-readout" });
    const reset = () => {
      for (const input of inputs) input.value = input.first;
      redraw();
    };
    const node = make(
      "div", { className: "explore-box playground", role: "group", ariaLabel: alt },
      make("div", { className: "playground-sliders" }, qLabel, gLabel, kLabel, eLabel),
      make("div", { className: "explore-bar" }, ...key.map(([label], i) => make("span", {}, swatches[i][0], ` ${label}`))),
      series, make("div", { className: "playground-pair" }, before, nis), told,
      make("div", { className: "explore-bar" },
        button("Default", "Back to the default setting", reset), button("Picture", "Back to the picture", back)),
    );

    function redraw() {
      if (!node.isConnected || !node.clientWidth) return;
      const colour = Object.fromEntries(Object.entries(colours).map(([name, pair]) => [name, pair[theme()]]));
      swatches.forEach(([swatch, name]) => (swatch.style.background = colour[name]));
      for (const input of [q, g, k]) input.tell(text(input.now(), 3));
      const at = epoch.now();
      epoch.tell(text(minutes[at]));
      const course = filter(given, q.now(), g.now(), k.now());
      const sigma = course.map((c) => Math.sqrt(c.cov[0][0]));
      const seen = [...truth.map((x) => x[0]), ...gnss.filter((z) => z != null)].map((z) => 100 * z);
      const [low, high] = [Math.min(...seen), Math.max(...seen)];
      const pad = 0.15 * (high - low);
      const span = [minutes[0], minutes.at(-1), "time [min]"];

      const a = axes(series, "", 240, span, [low - pad, high + pad, "separation [cm]"], { text });
      const edge = (sign) => course.map((c, i) => [a.px(minutes[i]), a.py(100 * (c.mean[0] + sign * 2 * sigma[i]))]);
      draw(a.area, "path", { d: `${path([...edge(1), ...edge(-1).reverse()])}Z`, fill: colour.estimate, "fill-opacity": 0.25 });
      draw(a.area, "path", { d: path(truth.map((x, i) => [a.px(minutes[i]), a.py(100 * x[0])])), fill: "none", stroke: colour.truth, "stroke-width": 1.5 });
      draw(a.area, "path", { d: path(course.map((c, i) => [a.px(minutes[i]), a.py(100 * c.mean[0])])), fill: "none", stroke: colour.estimate, "stroke-width": 1.5, "stroke-dasharray": "6 3" });
      gnss.forEach((z, i) => z != null && draw(a.area, "circle", { cx: a.px(minutes[i]), cy: a.py(100 * z), r: 2, fill: colour.seen }));
      draw(a.area, "line", { x1: a.px(minutes[at]), x2: a.px(minutes[at]), y1: 0, y2: 999, stroke: "currentColor", "stroke-dasharray": "2 3" });

      const { predicted, mean, cov } = course[at];
      const units = ([s, v]) => [100 * (s - predicted.mean[0]), 1e6 * (v - predicted.mean[1])];
      const [old, now] = [ellipse(predicted.mean, predicted.cov), ellipse(mean, cov)].map((points) => points.map(units));
      const reach = (i) => 1.15 * Math.max(...[...old, ...now].map((point) => Math.abs(point[i])));
      const [rx, ry] = [reach(0), reach(1)];
      const b = axes(before, "", 250, [-rx, rx, "separation less the predicted one [cm]"], [-ry, ry, "rate less the predicted one [µm/s]"], { text });
      for (const [points, name, dash] of [[old, "before", "6 3"], [now, "estimate", ""]])
        draw(b.area, "path", { d: `${path(points.map(([x, y]) => [b.px(x), b.py(y)]))}Z`, fill: colour[name], "fill-opacity": 0.12, stroke: colour[name], "stroke-width": 1.8, "stroke-dasharray": dash });
      const [tx, ty] = units(truth[at]);
      draw(b.area, "circle", { cx: b.px(tx), cy: b.py(ty), r: 4, fill: colour.truth });

      const values = course.map((c) => Math.max(c.nis, 1e-6));
      const top = Math.max(2, ...values.map((v) => Math.ceil(Math.log10(v))));
      const bottom = Math.min(-2, ...values.map((v) => Math.floor(Math.log10(v))));
      const every = Math.ceil((top - bottom) / 5);
      const yticks = [];
      for (let power = bottom; power <= top; power += every) yticks.push(+`1e${power}`);
      const c = axes(nis, "", 250, span, [yticks[0], 10 ** top, "NIS, and what 95 % should lie in"], { text, yticks, ylog: true });
      draw(c.area, "rect", { x: 0, width: 9999, y: c.py(bounds[1]), height: c.py(bounds[0]) - c.py(bounds[1]), fill: colour.estimate, "fill-opacity": 0.2 });
      values.forEach((v, i) => draw(c.area, "circle", { cx: c.px(minutes[i]), cy: c.py(v), r: 2, fill: colour.estimate }));

      const late = course.slice(1);
      const rms = Math.sqrt(late.reduce((sum, x, i) => sum + (x.mean[0] - truth[i + 1][0]) ** 2, 0) / late.length);
      const stated = Math.sqrt(late.reduce((sum, x) => sum + x.cov[0][0], 0) / late.length);
      const average = course.reduce((sum, x) => sum + x.nis, 0) / course.length;
      told.textContent = `Separation: stated sigma ${text(100 * stated, 3)} cm, rms of the errors ${text(100 * rms, 3)} cm. Mean NIS ${text(average, 3)}; two is consistent.`;
    }
    new MutationObserver(redraw).observe(document.documentElement, { attributeFilter: ["data-theme"] });
    let width = 0;
    new ResizeObserver(() => node.clientWidth !== width && ((width = node.clientWidth), redraw())).observe(node);
    return { node, draw: redraw, slider: q };
  }

  (window.exploreScripts ??= {})["playground.js"] = { build, filter };
})();
