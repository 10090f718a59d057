// Which channels of a recording fit the movements of the library: as many columns as these have.
import { counted } from "../parts/elements.js";

const total = (channels, width) => channels.reduce((sum, channel) => sum + width(channel), 0);
const width = ({ columns }) => columns?.length || 1;

export const columnCount = (channels) => total(channels, width);

/** Columns that channels are recognized by; an orientation turns in three ways, whatever its columns. */
const moving = (channels) => total(channels, (channel) => (channel.kind === "orientation" ? 3 : width(channel)));

/**
 * Names of the channels that are chosen at first: those of the library, or the default ones, or as many as fit. Of an
 * episode, the default ones are those of its first feature.
 */
export function fitting(channels, { n_dims: wanted, channels: ours, symbols }, usual) {
  const named = (names) => channels.filter(({ name }) => names.includes(name));
  const alike = named((ours ?? []).map((channel) => channel.name));
  const first = [];
  for (const channel of channels)
    if (channel.kind === "position" && moving([...first, channel]) <= wanted) first.push(channel);
  const all = [ours?.length === alike.length ? alike : [], usual ? named(usual) : channels, channels, first];
  const fits = (some) => some.length && (!symbols.length || moving(some) === wanted);
  return new Set((all.find(fits) ?? channels).map(({ name }) => name));
}

/** What to do where chosen channels do not fit; "" where they do. */
export function mismatch(chosen, { n_dims: wanted, symbols }) {
  const have = moving(chosen);
  if (!have) return "Choose at least one channel.";
  if (!symbols.length) return "No symbol is known yet: add a span, name it, and learn it.";
  return have === wanted
    ? ""
    : `Movements of this library have ${counted(wanted, "column")}; ${have} are chosen. Choose ${wanted}.`;
}
