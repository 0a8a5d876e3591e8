// Tables and listings that scroll sideways can be reached by the keyboard.
for (const part of document.querySelectorAll(".table-wrapper, pre, .math-wrapper, div.math")) part.tabIndex = 0;
