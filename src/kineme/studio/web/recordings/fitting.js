// Which channels of a recording fit the movements of the library: as many columns as these have.
import { counted } from "../parts/elements.js";

/** @param {any[]} channels */
export const columnCount = (channels) => channels.reduce((sum, channel) => sum + (channel.columns?.length || 1), 0);

/** Columns that channels are recognized by; an orientation turns in three ways, whatever its columns. */
const moving = (/** @type {any[]} */ channels) =>
  channels.reduce((sum, channel) => sum + (channel.kind === "orientation" ? 3 : channel.columns?.length || 1), 0);

/**
 * Names of the channels that are chosen at first.
 * @param {any[]} channels
 * @param {any} library
 * @returns {Set<string>}
 */
export function fitting(channels, { n_dims: wanted, channels: ours, symbols }) {
  const names = (/** @type {any[]} */ some) => new Set(some.map((channel) => channel.name));
  if (!symbols.length || moving(channels) === wanted) return names(channels);
  const alike = channels.filter((channel) => ours?.some((/** @type {any} */ other) => other.name === channel.name));
  if (moving(alike) === wanted) return names(alike);
  const first = [];
  for (const channel of channels)
    if (channel.kind === "position" && moving([...first, channel]) <= wanted) first.push(channel);
  return moving(first) === wanted ? names(first) : names(channels);
}

/**
 * What to do where chosen channels do not fit; "" where they do.
 * @param {any[]} chosen
 * @param {any} library
 * @returns {string}
 */
export function mismatch(chosen, { n_dims: wanted, symbols }) {
  const have = moving(chosen);
  if (!have) return "Choose at least one channel.";
  if (!symbols.length) return "No symbol is known yet: add a span, name it, and learn it.";
  return have === wanted
    ? ""
    : `Movements of this library have ${counted(wanted, "column")}; ${have} are chosen. Choose ${wanted}.`;
}
