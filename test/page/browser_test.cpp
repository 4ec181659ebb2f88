/// Pages as Chromium shows them: what their script answers. Skipped where Chromium or gnuplot is missing.
#include <cstdlib>
#include <random>
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
  // On a busy machine it sometimes hangs at its start: a second attempt, then it has failed.
  const std::string command =
      "cd '" + folder.path("") +
      "' && HOME=. timeout -k 5 60 chromium --headless --no-sandbox --disable-gpu --user-data-dir=profile "
      "--virtual-time-budget=3000 --dump-dom page.html >dom.html 2>log.txt";
  if (std::system(command.c_str()) != 0 && std::system(command.c_str()) != 0)
    return "chromium failed: " + host::read_file(folder.path("log.txt"), "log");
  const std::string dom = host::read_file(folder.path("dom.html"), "page");
  const std::string open = "<pre id=\"found\">";
  const std::size_t begin = dom.find(open) + open.size();
  return dom.substr(begin, dom.find("</pre>", begin) - begin);
}

bool is_installed(const std::string& program) {
  return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) == 0;
}
#define NEEDS_A_BROWSER()                          \
  for (const char* each : {"gnuplot", "chromium"}) \
    if (!is_installed(each)) GTEST_SKIP() << each << " is not installed"

/// What a reader does with a plot: points and drags at parts of the way along its axes, and reads what it says.
const std::string kReader = R"js(
SVGElement.prototype.setPointerCapture = () => {};
const plots = [...document.querySelectorAll('svg[data-plot]')];
function send(svg, type, px, py) {
  const {x, y} = JSON.parse(svg.dataset.plot), box = svg.getBoundingClientRect(), scale = box.width / svg.viewBox.baseVal.width;
  const along = (axis, part) => axis.pixels[0] + part * (axis.pixels[1] - axis.pixels[0]);
  svg.dispatchEvent(new PointerEvent(type, {clientX: box.left + scale * along(x, px), clientY: box.top + scale * along(y, py)}));
}
function drag(svg, from, to) { send(svg, 'pointerdown', ...from); send(svg, 'pointermove', ...to); send(svg, 'pointerup', ...to); }
const read = svg => svg.parentNode.querySelector('.readout').innerText.replace(/\n/g, '; ').replace(/-?\d+\.\d+/g, n => Number(Number(n).toPrecision(2)));
const words = (svg, what) => [...svg.querySelectorAll(what)].map(e => e.textContent).join(' ');
)js";

TEST(InABrowser, BarsAreReadAndEnlargedAlongEitherAxis) {
  NEEDS_A_BROWSER();
  Page page("Page");
  PlotSpec spec{"Bars", "", "torque [N·m]", {bars("before", {1, 30, 4}), bars("after", {2, 20, 3})}};
  spec.categories = {"joint 1", "joint 2", "joint 3"};
  page.plot(spec);
  const std::string found = found_by_reader(page, kReader + R"js(
const [svg] = plots;
send(svg, 'pointermove', 0.2, 0.5);
say(read(svg));
drag(svg, [0.5, -0.1], [0.5, 0.2]);  // upwards: the small bars
say(svg.getAttribute('class'));
send(svg, 'pointermove', 0.9, 0.5);
say(read(svg));
say(words(svg, '.axes text'));
send(svg, 'dblclick', 0.5, 0.5);
drag(svg, [0.7, 0.5], [1, 0.5]);  // sideways: one joint
say(words(svg, '.axes text'));
)js");
  EXPECT_EQ(found,
            "joint 1; before: 1 N·m; after: 2 N·m\n"
            "zoomed\n"
            "joint 3; before: 4 N·m; after: 3 N·m\n"
            "joint 1 joint 2 joint 3 0 2 4 6 torque [N·m] \n"
            "joint 3 0 10 20 30 torque [N·m] \n");
}

TEST(InABrowser, MapsAreEnlargedWithWhatStandsOnThem) {
  NEEDS_A_BROWSER();
  Page page("Page");
  MapSpec map{"Map", "x [m]", "y [m]", "N/mm", {0, 1, 2, 3, 4}, {0, 1, 2}, Eigen::MatrixXd(5, 3), {1, 2, 3}};
  for (Eigen::Index i = 0; i < 5; ++i) map.values.row(i).setConstant(static_cast<double>(i));
  map.frames = {{0.5, 1.5, 0.5, 1.5, "table", true}};
  map.places = {{3.5, 1.0, "A"}};
  page.plot(map);
  const std::string found = found_by_reader(page, kReader + R"js(
const [svg] = plots;
send(svg, 'pointermove', 0.375, 0.5);
say(read(svg));
drag(svg, [0.25, 0.1], [0.5, 0.9]);
send(svg, 'pointermove', 0.5, 0.5);
say(svg.getAttribute('class') + ': ' + read(svg));
say([...svg.querySelectorAll('.axes rect')].map(e => e.getAttribute('fill')).filter((c, k, all) => all.indexOf(c) === k).length + ' tints');
say(words(svg, '.axes ~ svg text'));
const [frame, place] = ['rect', 'circle'].map(what => svg.querySelector('.axes ~ svg:not(.window) ' + what)), {x} = JSON.parse(svg.dataset.plot);
const part = pixel => ((pixel - x.pixels[0]) / (x.pixels[1] - x.pixels[0])).toFixed(2);
say(part(+frame.getAttribute('x') + +frame.getAttribute('width')) + ' ' + part(+place.getAttribute('cx')));
)js");
  EXPECT_EQ(found,
            "x 1.5 m; y 1 m; 1 … 2 N/mm\n"
            "zoomed: x 1.5 m; y 1 m; 1 … 2 N/mm\n"
            "4 tints\n"
            "table A\n"
            "0.50 2.50\n");
}

/// The picture is drawn by another terminal of gnuplot than the drawing whose axes it has: its pixels say whether both agree.
TEST(InABrowser, APictureOfADenseCloudTellsValuesThatItShows) {
  NEEDS_A_BROWSER();
  std::mt19937 generator(7);
  std::normal_distribution<double> noise;
  Series cloud{"cloud", {}, {}, {}, Style::kPoints, Hue::kVermillion};
  for (int k = 0; k < 200'000; ++k) {
    cloud.x.push_back(noise(generator));
    cloud.y.push_back(noise(generator));
  }
  cloud.x.push_back(8.0);  // alone, so that it is known what is told beside it
  cloud.y.push_back(9.0);
  Page page("Page");
  page.plot({"Cloud", "speed [rad/s]", "torque [N·m]", {cloud}});
  const std::string found = found_by_reader(page, kReader + R"js(
const [svg] = plots;
send(svg, 'pointermove', 0.97, 0.97);
say(read(svg).replace(/^.*?; /, ''));
drag(svg, [0.9, 0.8], [1, 1]);
send(svg, 'pointermove', 0.97, 0.9);
say(svg.getAttribute('class') + ': ' + read(svg).replace(/^.*?; /, ''));
const image = new Image(), points = svg.querySelector('g.series path').getAttribute('d').match(/-?[\d.]+,-?[\d.]+/g).map(p => p.split(',').map(Number));
image.onload = () => {
  const canvas = document.createElement('canvas'), scale = image.naturalWidth / svg.viewBox.baseVal.width;
  [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0);
  const {data} = context.getImageData(0, 0, canvas.width, canvas.height), reddish = (x, y) => { const k = 4 * (y * canvas.width + x); return data[k] - data[k + 2] > 60; };
  const shown = points.filter(([x, y]) => [-1, 0, 1].some(i => [-1, 0, 1].some(j => reddish(Math.round(x * scale) + i, Math.round(y * scale) + j))));
  say((points.length > 500) + ' ' + (points.length < 4100) + ' ' + (shown.length === points.length));
};
image.src = svg.querySelector('image').getAttribute('href');
)js");
  EXPECT_EQ(found,
            "cloud: 9 N·m at 8 rad/s\n"
            "zoomed: cloud: 9 N·m at 8 rad/s\n"
            "true true true\n");
}

TEST(InABrowser, PlotsAnswerTablesSortAndFilesAreSaved) {
  NEEDS_A_BROWSER();
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
