(() => {
'use strict';
const clamp = (v, low, high) => Math.min(high, Math.max(low, v));
const decimalsOf = step => clamp(Math.ceil(-Math.log10(step)), 0, 12);
function help(text) {
  const p = document.createElement('p');
  p.className = 'controls';
  p.textContent = text;
  document.querySelector('footer').prepend(p);
}
