/*
 * How the search orders pages. Sphinx wants every word of a question in a page, and counts none more than another. Here
 * a word counts the more the fewer pages hold it, some words may be missing, titles, index entries and error messages
 * count by how much of them was asked for and most of all where they are what was typed, and pages written for readers
 * come before those that list names. Error messages come last, unless a whole one was typed.
 */
const Ranking = {
  /** The first part of a page's address that is listed -> how much its pages count, and what they are called. */
  chapters: {
    "how-to": [1.3, "How to"],
    start: [1.2, "Start"],
    tutorials: [1.15, "Tutorial"],
    "concepts/glossary": [1, "Glossary"],
    concepts: [1.15, "Concept"],
    guide: [1.15, "Guide"],
    "beside-others": [1, "Beside others"],
    migrating: [1, "Migrating"],
    "reference/equations": [1, "Reference"],
    "reference/generated/kineme-": [1, "Command"],
    "reference/generated/messages": [0.5, "Error message"],
    "reference/generated": [0.9, "Reference"],
    gallery: [0.85, "Gallery"],
    decisions: [0.7, "Decision"],
    "": [0.5, "Reference"],
  },
  most: 25,
  isMessage: (line) => /^message-\d+$/.test(line?.id ?? ""),
  mostMessages: 6,
  /** A question is a message that somebody met if it has as many stems, or is nearly all of one. */
  typed: (asked, score) => asked.length >= 4 || score > 0.9,

  /** Stems of the words of a text that say something; names such as load_lasa also by their parts. */
  words: (text) => {
    const found = splitQuery(text.toLowerCase()).flatMap((word) =>
      word.includes("_") ? [word, ...word.split("_")] : [word],
    );
    const stemmer = new Stemmer();
    return new Set(
      found.filter((word) => word && !stopwords.has(word) && !/^\d+$/.test(word)).map((word) => stemmer.stemWord(word)),
    );
  },

  /** The stems that a question asks for; of a name as column_stack its parts only where no page holds all of it. */
  asked: (query) => {
    const { pages } = Ranking.prepared;
    const names = splitQuery(query).filter((word) => word.includes("_"));
    const whole = names.filter((word) =>
      [...Ranking.words(word)].some((stem) => stem.includes("_") && pages.has(stem)),
    );
    const parts = new Set(whole.flatMap((word) => [...Ranking.words(word)].filter((stem) => !stem.includes("_"))));
    return [...Ranking.words(query)].filter((stem) => !parts.has(stem));
  },

  /** What the index holds, prepared once: stem -> pages; and titles and entries with their stems. */
  prepare: () => {
    const index = Search._index;
    const pages = new Map();
    const add = (word, page) => pages.get(word)?.add(page) ?? pages.set(word, new Set([page]));
    for (const [word, found] of Object.entries(index.terms)) for (const page of [found].flat()) add(word, page);
    const lines = [];
    for (const kind of ["alltitles", "indexentries"])
      for (const [text, places] of Object.entries(index[kind]))
        for (const [page, id] of places) {
          const words = Ranking.words(text);
          lines.push({ page, text, words, id, entry: kind === "indexentries" });
          for (const word of words) add(word, page);
        }
    for (const [inside, members] of Object.entries(index.objects))
      for (const [page, , , , name] of members) {
        const path = `${inside}.${name}`,
          text = path.split(".").slice(-2).join(".");
        lines.push({ page, text, words: Ranking.words(text), id: path, entry: true });
      }
    return { pages, lines, all: [...pages.keys()] };
  },

  /** A word of the question -> words of the index: itself, or those that begin with it while it is typed. */
  meant: (word, last) => {
    const { pages, all } = Ranking.prepared;
    if (pages.has(word)) return [word];
    return last && word.length > 2 ? all.filter((other) => other.startsWith(word)) : [];
  },

  /** Results in the form of Sphinx, the best one last. */
  results: (query) => {
    Ranking.prepared ??= Ranking.prepare();
    const { pages, lines } = Ranking.prepared;
    const { docnames, filenames, titles } = Search._index;
    const asked = Ranking.asked(query);
    const wanted = asked.map((word, k) => Ranking.meant(word, k === asked.length - 1)).filter((words) => words.length);
    const rarity = (word) => Math.log(1 + docnames.length / (pages.get(word)?.size ?? 1));
    const weights = wanted.map((words) => Math.max(...words.map(rarity)));
    const total = weights.reduce((sum, weight) => sum + weight, 0);
    const share = (has) => wanted.reduce((sum, words, k) => sum + (words.some(has) ? weights[k] : 0), 0);
    const bestLine = new Map();
    const messages = [];
    for (const line of lines) {
      const matched = share((word) => line.words.has(word));
      if (!matched) continue;
      const own = [...line.words].reduce((sum, word) => sum + rarity(word), 0);
      line.score = (2 * matched) / (total + Math.max(own, matched));
      if (line.text.toLowerCase() === query.trim().toLowerCase()) line.score = 1.5;
      else if (line.entry && docnames[line.page].startsWith("reference/generated/kineme")) line.score *= 0.8;
      if (Ranking.isMessage(line)) messages.push(line);
      else if (line.score > (bestLine.get(line.page)?.score ?? 0)) bestLine.set(line.page, line);
    }
    const found = [];
    docnames.forEach((name, page) => {
      const text = (name.endsWith("/index") ? 0.6 : 1) * (share((word) => pages.get(word)?.has(page)) / total);
      const line = bestLine.get(page);
      if (text > 0.6 || line?.score > 0.45)
        found.push([page, line, (text + 2 * (line?.score ?? 0)) * Ranking.chapter(name)[0]]);
    });
    messages.sort((a, b) => b.score - a.score).splice(Ranking.mostMessages);
    const last = [];
    for (const line of messages)
      if (line.score > 0.4)
        (Ranking.typed(asked, line.score) ? found : last).push([line.page, line, 1 + 2 * line.score]);
    const item = ([page, line, score]) => {
      const here = line && line.score > 0.3 && line.id ? `#${line.id}` : "";
      const message = Ranking.isMessage(line);
      const title = message
        ? line.text
        : here && !line.entry && line.text !== titles[page]
          ? `${titles[page]} > ${line.text}`
          : titles[page];
      return [
        docnames[page],
        title,
        here,
        Ranking.chapter(docnames[page])[1],
        score,
        filenames[page],
        message ? "index" : "text",
      ];
    };
    const inOrder = (results) => results.sort((a, b) => a[2] - b[2]);
    return [...inOrder(last), ...inOrder(found).slice(last.length - Ranking.most)].map(item);
  },

  chapter: (name) => Ranking.chapters[Object.keys(Ranking.chapters).find((start) => name.startsWith(start))],
};

Search._performSearch = Ranking.results;
