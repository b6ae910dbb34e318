// Pages that answer stand before pages that record.
var Scorer = {
  score: ([page, title, anchor, description, score, file, kind]) => {
    const rooms = [
      [/^(how-to|tutorials)\/(?!index)/, 12],
      [/^(start|questions|is-this-for-me|cluster|fits-elsewhere|glossary|wrong)$/, 10],
      [/^reference\/[\w-]+$/, 9],
      [/^(theory|project)\//, 8],
      [/^(gallery\/[\w-]+|extending|index)$/, 2],
      [/^(by-example|gallery\/examples\/.*|(how-to|tutorials)\/index)$/, -2],
      [/^(design|generated\/.*)$/, -6],
    ];
    const found = rooms.find(([room]) => room.test(page));
    return score + (found ? found[1] : 0);
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
