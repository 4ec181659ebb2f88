// Tables: a heading sorts upwards, again downwards, a third time as it was.
const blank = text => text === '' || text === '–';
const numberIn = text => {
  const t = text.replace(/−/g, '-').replace(/^[<>≤≥≈~±]\s*/, '').replace('∞', 'Infinity');
  const m = /^[-+]?(Infinity|(\d+\.?\d*|\.\d+)(e[-+]?\d+)?)/i.exec(t);
  return m ? Number(m[0]) : NaN;
};
function sortable(table) {
  const body = table.tBodies[0], rows = [...body.rows], heads = [...table.tHead.rows[0].cells];
  if (rows.length < 2) return;
  heads.forEach((head, c) => {
    if (!head.textContent) return;
    const button = document.createElement('button');
    button.type = 'button';
    button.className = 'sort';
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener('click', () => {
      const next = {null: 'ascending', ascending: 'descending', descending: null}[head.getAttribute('aria-sort')];
      heads.forEach(h => h.removeAttribute('aria-sort'));
      if (next) head.setAttribute('aria-sort', next);
      body.append(...(next ? sorted(rows, c, next === 'ascending' ? 1 : -1) : rows));
    });
  });
}
function sorted(rows, column, sign) {
  const text = row => row.cells[column].textContent.trim();
  const full = rows.filter(row => !blank(text(row))), empty = rows.filter(row => blank(text(row)));
  const numbers = full.every(row => !isNaN(numberIn(text(row))));
  const order = numbers ? (a, b) => numberIn(text(a)) - numberIn(text(b)) || 0 : (a, b) => text(a).localeCompare(text(b), 'en', {numeric: true});
  return [...full.sort((a, b) => sign * order(a, b)), ...empty];
}

document.querySelectorAll('.scroll>table').forEach(sortable);
help('Tables: click on a heading to sort, again for the other direction, a third time for the order as it was.');
