// A name that may break into lines where its words meet, as in DoubleBendedLine or pick_and_place, and not within them.

/** @param {string} name @returns {(Node|string)[]} */
export const breakable = (name) =>
  name
    .split(/(?<=\p{Ll})(?=\p{Lu})|(?<=[\p{L}\p{N}][_\-./:])(?=[\p{L}\p{N}])/u)
    .flatMap((part, k) => (k ? [document.createElement("wbr"), part] : [part]));
