// Over file:// a page cannot read its neighbours, so the search lists titles without an excerpt instead of failing.
if (location.protocol === "file:" && typeof DOCUMENTATION_OPTIONS !== "undefined")
  DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;

// A box that scrolls can be reached, and so scrolled, from the keyboard.
function reachScrollingBoxes() {
  for (const box of document.querySelectorAll(".pst-scrollable-table-container, .bd-article pre")) {
    const wide = box.scrollWidth > box.clientWidth;
    if (wide) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
    box.classList.toggle("scrolls", wide);
  }
}
window.addEventListener("load", reachScrollingBoxes);
window.addEventListener("resize", reachScrollingBoxes);
document.addEventListener("toggle", reachScrollingBoxes, true);

// A figure leads to its image alone, where a phone can enlarge it.
function linkFigures() {
  for (const image of document.querySelectorAll(".bd-article figure img")) {
    const link = document.createElement("a");
    const twin = [...image.classList].find((name) => name === "twin-light" || name === "twin-dark");
    link.className = twin ? `whole ${twin}` : "whole";
    link.href = image.src;
    image.replaceWith(link);
    link.append(image);
  }
}
window.addEventListener("DOMContentLoaded", linkFigures);

// The page with all claims: boxes for part and verdict hide the other rows.
function filterClaims() {
  const tables = [...document.querySelectorAll("table.claims")];
  if (!document.querySelector("#all-claims") || !tables.length) return;
  const parts = tables.map((table) => table.closest("section"));
  const names = parts.map((section) => section.querySelector("h2").firstChild.textContent.trim());
  const word = (row) => row.querySelector(".verdict").textContent.split(",")[0];
  const rows = tables.flatMap((table) => [...table.querySelectorAll("tbody tr")]);
  const chooser = (title, options) => {
    const label = document.createElement("label");
    const select = document.createElement("select");
    for (const option of ["all", ...options]) select.add(new Option(option));
    label.append(`${title} `, select);
    return [label, select];
  };
  const [partLabel, part] = chooser("Paper", names);
  const [wordLabel, verdict] = chooser("Verdict", [...new Set(rows.map(word))]);
  const count = document.createElement("output");
  const apply = () => {
    parts.forEach((section, k) => (section.hidden = part.value !== "all" && part.value !== names[k]));
    for (const row of rows) row.hidden = verdict.value !== "all" && word(row) !== verdict.value;
    const shown = rows.filter((row) => !row.hidden && !row.closest("section").hidden).length;
    count.textContent = `${shown} of ${rows.length} claims`;
  };
  const box = document.createElement("div");
  box.className = "claim-filter";
  box.append(partLabel, wordLabel, count);
  parts[0].before(box);
  part.addEventListener("change", apply);
  verdict.addEventListener("change", apply);
  apply();
}
window.addEventListener("DOMContentLoaded", filterClaims);
