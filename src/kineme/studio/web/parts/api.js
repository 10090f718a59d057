// Questions to the server, in JSON; what goes wrong is an Error with the server's sentence.
import { handOver } from "./elements.js";

/** What the server answered with a status of 4xx or 5xx. */
class Refused extends Error {
  constructor(text, status) {
    super(text);
    this.status = status;
  }
}

/** An address; the values in it may hold any character. */
export const path = (parts, ...values) => String.raw({ raw: parts }, ...values.map(encodeURIComponent));

/** @returns {Promise<Response>} */
export async function request(path, options = {}) {
  let response;
  try {
    response = await fetch(path, { credentials: "same-origin", ...options });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Refused("The server does not answer. Start it again; nothing is lost.", 0);
  }
  if (!response.ok && response.status !== 304) {
    const { error } = await response.json().catch(() => ({}));
    throw new Refused(typeof error === "string" ? error : `The server answered ${response.status}.`, response.status);
  }
  return response;
}

export const get = async (path) => (await request(path)).json();

const asJson = { "Content-Type": "application/json" };
const json = (body) => ({ method: "POST", headers: asJson, body: JSON.stringify(body) });

export const post = async (path, body = {}, signal = undefined) =>
  (await request(path, { ...json(body), signal })).json();

export const remove = async (path) => (await request(path, { method: "DELETE" })).json();

/** Ask for a file and hand it to the person. @returns The name under which it is saved. */
export async function download(path, body, name) {
  const response = await request(path, json(body));
  const said = /filename\*=UTF-8''([^;]+)/.exec(response.headers.get("Content-Disposition") ?? "");
  const saved = said ? decodeURIComponent(said[1]) : name;
  handOver(await response.blob(), saved);
  return saved;
}
