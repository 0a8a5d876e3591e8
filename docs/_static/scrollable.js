// Tables and listings that scroll sideways can be reached by the keyboard.
for (const part of document.querySelectorAll(".table-wrapper, pre, .math-wrapper, div.math")) part.tabIndex = 0;
// Captions of the list of pages are headings, of which level the theme does not say.
for (const part of document.querySelectorAll("[role=heading]:not([aria-level])")) part.ariaLevel = "2";
