// Over file:// a page cannot read its neighbours, so the search lists titles without an excerpt instead of failing.
if (location.protocol === "file:" && window.DOCUMENTATION_OPTIONS) DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
