"use strict";

const wanted = () => (new URLSearchParams(window.location.search).get("q") || "").trim().split(".").pop();

// Whoever searches has a question: pages of the guide come first, the one on symptoms before all, then names.
var Scorer = {
  score: ([docname, title, anchor, descr, score, filename, kind]) => {
    // A word of that page's title is a symptom; a name that is searched for in full is meant.
    if (docname === "symptoms") return score < Scorer.title ? score : score + 100;
    if (docname.startsWith("auto/api/")) return title.endsWith(`.${wanted()}`) ? score + 30 : score - 10;
    return kind === "title" ? score + 15 : score;
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
