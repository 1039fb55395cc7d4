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
