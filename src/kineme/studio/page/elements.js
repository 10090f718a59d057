// Elements of the page.

export const element = (id) => document.getElementById(id);

/** Make an element with properties; children that are strings become text. */
export function make(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}
