// Questions to the server, in JSON; what goes wrong is an Error with the server's sentence.

/** What the server answered with a status of 4xx or 5xx. */
class Refused extends Error {
  /** @param {string} text @param {number} status */
  constructor(text, status) {
    super(text);
    this.status = status;
  }
}

/** @param {Response} response */
async function sentence(response) {
  try {
    const said = await response.json();
    return typeof said.error === "string" ? said.error : `The server answered ${response.status}.`;
  } catch {
    return `The server answered ${response.status}.`;
  }
}

/** @param {string} path @param {RequestInit} options @returns {Promise<Response>} */
export async function request(path, options = {}) {
  let response;
  try {
    response = await fetch(path, { credentials: "same-origin", ...options });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Refused("The server does not answer. Start it again; nothing is lost.", 0);
  }
  if (!response.ok && response.status !== 304) throw new Refused(await sentence(response), response.status);
  return response;
}

/** @param {string} path @returns {Promise<any>} */
export const get = async (path) => (await request(path)).json();

/**
 * What is there now and its tag; null where it is what the page has.
 * @param {string} path
 * @param {string|null} tag Of the answer before.
 * @returns {Promise<{body: any, tag: string|null}|null>}
 */
export async function newer(path, tag) {
  const response = await request(path, tag ? { headers: { "If-None-Match": tag } } : {});
  return response.status === 304 ? null : { body: await response.json(), tag: response.headers.get("ETag") };
}

/** @param {any} body @returns {RequestInit} */
const json = (body) => ({
  method: "POST",
  headers: { "Content-Type": "application/json" },
  body: JSON.stringify(body),
});

/** @param {string} path @param {any} body @param {AbortSignal} [signal] @returns {Promise<any>} */
export const post = async (path, body = {}, signal = undefined) =>
  (await request(path, { ...json(body), signal })).json();

/** @param {string} path @returns {Promise<any>} */
export const remove = async (path) => (await request(path, { method: "DELETE" })).json();

/** Ask for a file and hand it to the person. @param {string} path @param {any} body @param {string} name */
export async function download(path, body, name) {
  const response = await request(path, json(body));
  const said = /filename\*=UTF-8''([^;]+)/.exec(response.headers.get("Content-Disposition") ?? "");
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await response.blob());
  link.download = said ? decodeURIComponent(said[1]) : name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  return link.download;
}
