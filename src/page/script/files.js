// Files: numbers to the base 64, some digits each; the highest is left for "none".
const digits = 'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/';
function columnOf({low, step, places, data}) {
  const values = [], none = Math.pow(64, places) - 1;
  for (let k = 0; k < data.length; k += places) {
    let n = 0;
    for (let i = 0; i < places; ++i) n = 64 * n + digits.indexOf(data[k + i]);
    values.push(n === none ? '' : (low + step * n).toFixed(decimalsOf(step || 1)));
  }
  return values;
}
function csvOf(file) {
  const columns = file.columns.map(columnOf);
  const lines = [...file.notes.map(note => `# ${note}`), file.columns.map(c => c.name).join(',')];
  columns[0].forEach((v, k) => lines.push(columns.map(c => c[k]).join(',')));
  return lines.join('\n') + '\n';
}
function offer(element) {
  const file = JSON.parse(element.textContent), link = document.createElement('a'), paragraph = document.createElement('p');
  paragraph.className = 'download controls';
  link.textContent = file.label;
  link.download = file.name;
  link.href = '#';
  link.addEventListener('click', () => { if (link.protocol !== 'blob:') link.href = URL.createObjectURL(new Blob([csvOf(file)], {type: 'text/csv'})); });
  paragraph.append(link);
  element.after(paragraph);
}

document.querySelectorAll('script.file').forEach(offer);
