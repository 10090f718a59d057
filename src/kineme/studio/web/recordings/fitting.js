// Which channels of a recording fit the movements of the library: as many columns as these have.
import { counted } from "../parts/elements.js";

/** @param {any[]} channels */
export const columnCount = (channels) => channels.reduce((sum, channel) => sum + (channel.columns?.length || 1), 0);

/** Columns that channels are recognized by; an orientation turns in three ways, whatever its columns. */
const moving = (/** @type {any[]} */ channels) =>
  channels.reduce((sum, channel) => sum + (channel.kind === "orientation" ? 3 : channel.columns?.length || 1), 0);

/**
 * Names of the channels that are chosen at first: those of the library, or the default ones, or as many as fit.
 * @param {any[]} channels
 * @param {any} library
 * @param {string[]} [usual] Of an episode, those of its first feature.
 * @returns {Set<string>}
 */
export function fitting(channels, { n_dims: wanted, channels: ours, symbols }, usual) {
  const named = (/** @type {string[]} */ names) => channels.filter(({ name }) => names.includes(name));
  const alike = named((ours ?? []).map((/** @type {any} */ channel) => channel.name));
  /** @type {any[]} */
  const first = [];
  for (const channel of channels)
    if (channel.kind === "position" && moving([...first, channel]) <= wanted) first.push(channel);
  const all = [ours?.length === alike.length ? alike : [], usual ? named(usual) : channels, channels, first];
  const fits = (/** @type {any[]} */ some) => some.length && (!symbols.length || moving(some) === wanted);
  return new Set((all.find(fits) ?? channels).map(({ name }) => name));
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
