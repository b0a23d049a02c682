#include <base/error.h>
#include <base/folds.h>
#include <base/outputs.h>
#include <base/process.h>
#include <base/utf8.h>
#include <report/chart/axis.h>
#include <report/chart/chart.h>
#include <report/chart/labels.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string_view>
#include <utility>

namespace palpate::report {

namespace {

// Okabe and Ito's colours without the yellow, which white paper swallows: M. Okabe, K. Ito, "Color Universal Design", 2008.
constexpr std::array<const char*, 7> colours{"#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"};
// gnuplot's markers: circle, square, triangle, diamond, triangle down, pentagon; filled, then hollow. Seven colours and
// twelve markers: 84 series before a pair comes again.
constexpr std::array<int, 12> markers{7, 5, 9, 13, 11, 15, 6, 4, 8, 12, 10, 14};
constexpr std::size_t markersOnLine = 14;

constexpr int left = 130, afterPlot = 24, top = 66, bottom = 96;  // around the plot [px]
constexpr int plotColumns = 1100, plotRows = 720;                 // [px]
constexpr int letter = 11, noteLetter = 10, noteLine = 26;        // typical sizes of the fonts below [px]
constexpr std::size_t legendRows = 22;                            // as many as fit beside the plot
constexpr std::size_t longestName = 60, longestTitle = 84, longestLabel = 70, longestPointLabel = 30;

// Text as UTF-8 on one line, at most `most` letters.
std::string tidy(std::string_view text, std::size_t most)
{
    using nlohmann::json;
    const std::string valid =
        json::parse(json(text).dump(-1, ' ', false, json::error_handler_t::replace)).get<std::string>();
    std::string out;
    std::size_t letters = 0;
    for (const char c : valid) {
        if (base::beginsCharacter(c) && ++letters > most) {
            return out + "…";
        }
        out += static_cast<unsigned char>(c) < 0x20 || c == 0x7F ? ' ' : c;
    }
    return out;
}

std::size_t letters(std::string_view utf8)
{
    return static_cast<std::size_t>(std::ranges::count_if(utf8, base::beginsCharacter));
}

// A string of gnuplot's. All but letters, digits and spaces are numbers in it, so that nothing is left to expand or to end
// it.
std::string quoted(std::string_view text, std::size_t most)
{
    constexpr std::string_view plain = " abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
    std::string out = "\"";
    for (const char c : tidy(text, most)) {
        out += plain.find(c) != std::string_view::npos ? std::string(1, c)
                                                       : fmt::format("\\{:03o}", static_cast<unsigned char>(c));
    }
    return out + "\"";
}

// Lines of at most `most` letters, broken at spaces.
std::vector<std::string> wrapped(std::string_view text, std::size_t most)
{
    std::vector<std::string> lines;
    std::string line;
    const auto flush = [&] {
        if (!line.empty()) {
            lines.push_back(std::exchange(line, {}));
        }
    };
    while (!text.empty()) {
        const std::size_t end = std::min(text.find_first_of(" \n"), text.size());
        const std::string word = tidy(text.substr(0, end), most);
        if (!line.empty() && letters(line) + 1 + letters(word) > most) {
            flush();
        }
        line += (line.empty() || word.empty() ? "" : " ") + word;
        if (end < text.size() && text[end] == '\n') {
            flush();
        }
        text.remove_prefix(std::min(end + 1, text.size()));
    }
    flush();
    return lines;
}

int legendWidth(const Chart& chart)
{
    const auto width = [](const auto& named) { return letters(tidy(named.name, longestName)); };
    const std::size_t most = base::largestOf(chart.bounds, width, base::largestOf(chart.series, width, std::size_t{0}));
    const std::size_t columns = (chart.series.size() + chart.bounds.size() + legendRows - 1) / legendRows;
    return static_cast<int>(columns) * (80 + letter * static_cast<int>(most));
}

std::string axisCommands(char name, const std::string& label, bool log, AxisRange range)
{
    // gnuplot's own rounding must not cut a mark at the end of a range.
    const double room = log ? 1e-9 : 0;
    std::string out = fmt::format("set {0}label {1}\nset {0}range [{2}:{3}]\n", name, quoted(label, longestLabel),
                                  range.low * (1 - room), range.high * (1 + room));
    if (!log) {
        return out;
    }
    std::string ticks;
    for (const AxisTick& t : logTicks(range)) {
        ticks += fmt::format("{}'{}' {} {}", ticks.empty() ? "" : ", ", t.label, t.at, t.label.empty() ? 1 : 0);
    }
    return out + fmt::format("set logscale {0} 10\nset {0}tics ({1})\n", name, ticks);
}

std::string dataBlock(const ChartSeries& s, std::size_t index)
{
    std::string out = fmt::format("$s{} << END\n", index);
    for (std::size_t k = 0; k < s.x.size(); ++k) {
        out += std::isnan(s.x[k]) ? "NaN NaN\n" : fmt::format("{} {}\n", s.x[k], s.y[k]);
    }
    return out + "END\n";
}

std::string dataCommands(const Chart& chart)
{
    std::string data, plots;
    int plain = 0;  // lines without markers: told apart by their dashes
    for (std::size_t i = 0; i < chart.series.size(); ++i) {
        const ChartSeries& s = chart.series[i];
        data += dataBlock(s, i);
        const std::string marks = fmt::format("pt {} ps 1.7", markers[i % markers.size()]);
        const std::string style = s.line && s.markers
                                      ? fmt::format("linespoints lw 2.2 pi {} {}", s.x.size() / markersOnLine + 1, marks)
                                  : s.line ? fmt::format("lines lw 2.2 dt {}", ++plain)
                                           : "points lw 1.6 " + marks;
        plots += fmt::format("{}$s{} using 1:2 with {} lc rgb '{}' title {}", plots.empty() ? "" : ", ", i, style,
                             s.markers ? colours[i % colours.size()] : "#999999", quoted(s.name, longestName));
    }
    for (std::size_t i = 0; i < chart.bounds.size(); ++i) {
        plots += fmt::format(", {} with lines lw 1.8 dt {} lc rgb '#444444' title {}", chart.bounds[i].y, i % 4 + 2,
                             quoted(chart.bounds[i].name, longestName));
    }
    return data + "plot " + plots + "\n";
}

double share(double value, AxisRange range, bool log)
{
    return log ? std::log(value / range.low) / std::log(range.high / range.low)
               : (value - range.low) / (range.high - range.low);
}

// The texts beside points, where they cover each other and markers least.
std::string pointLabels(const DrawableChart& drawn, int width, int height)
{
    constexpr double textHeight = 17, textLetter = 8;  // of the font below [px]
    std::vector<PointLabel> labels;
    std::vector<std::string> commands;
    std::vector<glm::dvec2> markers;
    for (std::size_t i = 0; i < drawn.chart.series.size(); ++i) {
        const ChartSeries& s = drawn.chart.series[i];
        for (std::size_t k = 0; k < s.x.size(); ++k) {
            if (std::isnan(s.x[k])) {
                continue;
            }
            const glm::dvec2 at(plotColumns * share(s.x[k], drawn.x, drawn.chart.logX),
                                plotRows * share(s.y[k], drawn.y, drawn.chart.logY));
            if (s.markers) {
                markers.push_back(at);
            }
            if (s.written.empty() || s.written[k].empty()) {
                continue;
            }
            const auto wide = static_cast<double>(letters(tidy(s.written[k], longestPointLabel)));
            labels.push_back({at, {textLetter * wide, textHeight}});
            commands.push_back(
                fmt::format("set label {} at first {}, first {} left font 'Sans,11' textcolor rgb '{}' front",
                            quoted(s.written[k], longestPointLabel), s.x[k], s.y[k], colours[i % colours.size()]));
        }
    }
    std::string out;
    const auto places = placedLabels(labels, markers);
    for (std::size_t i = 0; i < labels.size(); ++i) {
        out += fmt::format("{} offset screen {}, screen {}\n", commands[i], places[i].x / width, places[i].y / height);
    }
    return out;
}

std::string script(const DrawableChart& drawn)
{
    const Chart& c = drawn.chart;
    const int width = left + plotColumns + afterPlot + legendWidth(c);
    const auto note = wrapped(c.note, static_cast<std::size_t>((width - 2 * afterPlot) / noteLetter));
    const int noteHeight = note.empty() ? 0 : 12 + noteLine * static_cast<int>(note.size());
    const int height = top + plotRows + bottom + noteHeight;
    const auto across = [&](int x) { return static_cast<double>(x) / width; };
    const auto up = [&](int y) { return static_cast<double>(y) / height; };

    std::string out = fmt::format(
        "set encoding utf8\n"
        "set terminal pngcairo noenhanced color size {},{} font 'Sans,15' background rgb 'white'\n"
        "set margins at screen {}, at screen {}, at screen {}, at screen {}\n",
        width, height, across(left), across(left + plotColumns), up(bottom + noteHeight),
        up(bottom + noteHeight + plotRows));
    out +=
        "set border 3 lw 1.5 lc rgb '#333333'\nset tics nomirror out textcolor rgb '#222222'\n"
        "set grid xtics ytics lw 1 lt 1 lc rgb '#DDDDDD'\n"
        "set samples 2\n";
    out +=
        fmt::format("set key at screen {}, screen {} left top Left reverse noinvert samplen 1.6 spacing 1.35 maxrows {}\n",
                    across(left + plotColumns + afterPlot), up(bottom + noteHeight + plotRows), legendRows);
    out += fmt::format("set title {} font 'Sans Bold,17' offset 0,0.2\n", quoted(c.title, longestTitle));
    for (std::size_t i = 0; i < note.size(); ++i) {
        out += fmt::format("set label {} at screen {}, screen {} left font 'Sans,13' textcolor rgb '#444444'\n",
                           quoted(note[i], note[i].size()), across(afterPlot),
                           up(noteLine * static_cast<int>(note.size() - i) - 6));
    }
    return out + axisCommands('x', c.xLabel, c.logX, drawn.x) + axisCommands('y', c.yLabel, c.logY, drawn.y) +
           pointLabels(drawn, width, height) + dataCommands(c);
}

using TemporaryFile = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

// A file without a name: it is gone when it is closed.
TemporaryFile temporaryFile(const std::filesystem::path& file)
{
    TemporaryFile out(std::tmpfile(), &std::fclose);
    base::failIf(!out, "{}: no temporary file can be made ({}): make room in /tmp", file.native(), std::strerror(errno));
    return out;
}

std::string contents(std::FILE* in)
{
    std::rewind(in);
    std::string out;
    std::array<char, 65536> part{};
    for (std::size_t n = 0; (n = std::fread(part.data(), 1, part.size(), in)) > 0;) {
        out.append(part.data(), n);
    }
    return out;
}

// gnuplot's exit status, or -1 when it was killed. Standard input, output and error are open files.
int runGnuplot(const std::array<std::FILE*, 3>& streams, const std::filesystem::path& file)
{
    // The settings of whoever runs this must not change the picture.
    const auto [pid, error] =
        base::start({{"gnuplot", "--default-settings"}, {fileno(streams[0]), fileno(streams[1]), fileno(streams[2])}});
    base::failIf(error != 0, "{}: gnuplot, which draws it, cannot be started ({}): apt-get install gnuplot-nox",
                 file.native(), std::strerror(error));
    return base::exitStatus(pid);
}

// gnuplot's first line that says something; it shows the command before, and a caret under it.
std::string complaint(std::string_view errors)
{
    const std::size_t line = errors.find("line ");
    errors.remove_prefix(line == std::string_view::npos ? 0 : line);
    errors.remove_prefix(std::min(errors.find_first_not_of(" \n"), errors.size()));
    return tidy(errors.substr(0, errors.find('\n')), 200);
}

std::string drawn(const std::string& commands, const std::filesystem::path& file)
{
    const TemporaryFile in = temporaryFile(file), out = temporaryFile(file), errors = temporaryFile(file);
    const bool written = std::fwrite(commands.data(), 1, commands.size(), in.get()) == commands.size();
    base::failIf(!written || std::fflush(in.get()) != 0, "{}: the chart's data do not fit into /tmp: make room there",
                 file.native());
    std::rewind(in.get());
    const int status = runGnuplot({in.get(), out.get(), errors.get()}, file);
    std::string png = contents(out.get());
    // gnuplot ends well also when the disk was full: a whole picture ends with this chunk.
    if (status != 0 || !png.starts_with("\x89PNG") || !png.ends_with("IEND\xAE\x42\x60\x82")) {
        const std::string why = complaint(contents(errors.get()));
        throw base::error(
            "{}: gnuplot could not draw it (exit status {}{}{}): check room in /tmp, and that Debian's "
            "gnuplot-nox is installed",
            file.string(), status, why.empty() ? "" : ": ", why);
    }
    return png;
}

}  // namespace

void writeChartPng(const Chart& chart, const std::filesystem::path& file)
{
    base::writeWhole(file, drawn(script(drawableChart(chart, file)), file));
}

}  // namespace palpate::report
