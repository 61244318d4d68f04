// Text of elements that is set many times a second.

/** Sets the text of an element if it is another one: each set makes the browser lay out the page anew. @param {Element} element @param {string} text */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Sets a property of an element if it is another one: also the same value makes the browser look through the page. @param {any} element @param {string} name @param {any} value */
export function setProperty(element, name, value) {
  if (element[name] !== value) element[name] = value;
}
