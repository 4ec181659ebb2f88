/// Pages as Chromium shows them: what their script answers. Skipped where Chromium or gnuplot is missing.
#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

#include "heft/host/file.hpp"
#include "heft/page/page.hpp"
#include "support/temporary_folder.hpp"

namespace heft::page {
namespace {

/// The page with a reader's doings at its end, run by Chromium; what they leave as text in the element of id "found".
std::string found_by_reader(const Page& page, const std::string& doings) {
  const test::TemporaryFolder folder;
  std::string html = page.html();
  html.insert(
      html.rfind("</body>"),
      "<pre id=\"found\"></pre><script>const say = text => document.querySelector('#found').append(text + '\\n');" +
          doings + "</script>");
  host::write_file_atomically(folder.path("page.html"), html);
  const std::string command =
      "cd '" + folder.path("") +
      "' && HOME=. chromium --headless --no-sandbox --disable-gpu --user-data-dir=profile "
      "--virtual-time-budget=3000 --dump-dom page.html >dom.html 2>log.txt";
  if (std::system(command.c_str()) != 0)
    return "chromium failed: " + host::read_file(folder.path("log.txt"), "log");
  const std::string dom = host::read_file(folder.path("dom.html"), "page");
  const std::string open = "<pre id=\"found\">";
  const std::size_t begin = dom.find(open) + open.size();
  return dom.substr(begin, dom.find("</pre>", begin) - begin);
}

TEST(InABrowser, PlotsAnswerTablesSortAndFilesAreSaved) {
  for (const char* program : {"gnuplot", "chromium"}) {
    if (std::system(("command -v " + std::string(program) + " >/dev/null 2>&1").c_str()) != 0)
      GTEST_SKIP() << program << " is not installed";
  }
  Page page("Page");
  page.plot({"Line", "time [s]", "torque [N·m]", {{"up", {0, 1, 2, 3}, {0, 10, 20, 30}}}});
  page.table(Table({"joint", "share"})
                 .add_row({"joint 10", "−3 %"})
                 .add_row({"joint 9", "1.2e+03 %"})
                 .add_row({"joint 1", "–"})
                 .add_row({"joint 2", "7 ± 1"}));
  page.file({"Save", "a.csv", {"note"}, {{"time", {0, 0.5}}, {"value", {-1, 1}}}});
  const std::string found = found_by_reader(page, R"js(
const svg = document.querySelector('svg[data-plot]'), x = JSON.parse(svg.dataset.plot).x.pixels;
const send = (type, part) => {
  const box = svg.getBoundingClientRect(), scale = box.width / svg.viewBox.baseVal.width;
  svg.dispatchEvent(new PointerEvent(type, {clientX: box.left + scale * (x[0] + part * (x[1] - x[0])), clientY: box.top + box.height / 2}));
};
const read = () => document.querySelector('.readout').innerText.replace(/\n/g, '; ').replace(/\d+\.\d+/g, n => Number(n).toPrecision(2));
svg.setPointerCapture = () => {};
send('pointermove', 2 / 3);
say(read());
send('pointerdown', 0.25); send('pointermove', 0.75); send('pointerup', 0.75);
say(svg.getAttribute('class'));
send('pointermove', 0);
say(read());
send('pointermove', 0.5); send('dblclick', 0.5);
say('whole:' + svg.getAttribute('class'));
svg.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight'}));
say(read());
const cells = c => [...document.querySelectorAll('tbody tr')].map(row => row.cells[c].textContent).join(', ');
document.querySelectorAll('th').forEach((head, c) => {
  for (let k = 0; k < 3; ++k) { head.firstChild.click(); say(head.getAttribute('aria-sort') + ': ' + cells(c)); }
});
let saved;
const make = URL.createObjectURL;
URL.createObjectURL = blob => { saved = blob; return make(blob); };
document.querySelector('.download a').click();
saved.text().then(say);
)js");
  EXPECT_EQ(found,
            "time 2.0 s; up: 20 N·m\n"
            "zoomed\n"
            "time 0.75 s; up: 7.5 N·m\n"
            "whole:\n"
            "time 1.5 s; up: 15 N·m\n"
            "ascending: joint 1, joint 2, joint 9, joint 10\n"
            "descending: joint 10, joint 9, joint 2, joint 1\n"
            "null: joint 10, joint 9, joint 1, joint 2\n"
            "ascending: −3 %, 7 ± 1, 1.2e+03 %, –\n"
            "descending: 1.2e+03 %, 7 ± 1, −3 %, –\n"
            "null: −3 %, 1.2e+03 %, –, 7 ± 1\n"
            "# note\ntime,value\n0.00000000,-1.000000\n0.50000000,1.000000\n\n");
}

}  // namespace
}  // namespace heft::page
