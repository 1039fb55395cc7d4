// Over file:// a page cannot read its neighbours, so the search lists titles without an excerpt instead of failing.
if (location.protocol === "file:" && typeof DOCUMENTATION_OPTIONS !== "undefined")
  DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;

// A box that scrolls can be reached, and so scrolled, from the keyboard.
function reachScrollingBoxes() {
  for (const box of document.querySelectorAll(".pst-scrollable-table-container, .bd-article pre")) {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  }
}
window.addEventListener("load", reachScrollingBoxes);
window.addEventListener("resize", reachScrollingBoxes);
document.addEventListener("toggle", reachScrollingBoxes, true);
