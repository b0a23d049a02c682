#include "manifest.h"

#include <fstream>
#include <regex>
#include <sstream>

namespace palpate::volume::manifest {

namespace fs = std::filesystem;

namespace {

std::vector<double> numbers(const std::string& text)
{
    std::istringstream in(text);
    std::vector<double> out;
    for (double v = 0; in >> v;) {
        out.push_back(v);
    }
    return out;
}

std::map<double, std::uint64_t> pairs(const std::string& text)
{
    std::map<double, std::uint64_t> out;
    const std::regex pair("(-?[\\d.]+):(\\d+)");
    for (std::sregex_iterator it(text.begin(), text.end(), pair), end; it != end; ++it) {
        out[std::stod((*it)[1])] = std::stoull((*it)[2]);
    }
    return out;
}

}  // namespace

fs::path folder()
{
    return PALPATE_TEST_DATA;
}

std::vector<Row> rows()
{
    std::vector<Row> all;
    std::ifstream in(folder() / "MANIFEST.md");
    std::string section;
    for (std::string line; std::getline(in, line);) {
        if (line.rfind("## ", 0) == 0) {
            section = line.substr(3);
        }
        if (line.rfind("| ", 0) != 0 || line.rfind("| file |", 0) == 0) {
            continue;
        }
        std::vector<std::string> cells;
        std::istringstream parts(line.substr(1));
        for (std::string cell; std::getline(parts, cell, '|');) {
            cells.push_back(std::regex_replace(cell, std::regex("^ +| +$"), ""));
        }
        cells.resize(8);
        Row row{section + "/" + cells[0], folder() / section / cells[0], cells[2], cells[3], cells[5], cells[6]};
        if (row.isSeries()) {
            row.path = row.path.parent_path();
        }
        all.push_back(row);
    }
    return all;
}

Counts countsOf(const Row& row)
{
    Counts counts;
    std::smatch match;
    const std::string& text = row.counts;
    if (!std::regex_search(text, match, std::regex("(\\d+) values( \\(non-integer\\))?(?: \\+(\\d+) non-finite)?: "))) {
        return counts;
    }
    counts.different = std::stoul(match[1]);
    counts.nonInteger = match[2].matched;
    counts.nonFinite = match[3].matched ? std::stoul(match[3]) : 0;
    const std::string rest = text.substr(static_cast<std::size_t>(match.position() + match.length()));
    std::smatch range;
    if (std::regex_search(rest, range, std::regex("min (\\S+) max (\\S+); zero (\\d+)"))) {
        counts.least = std::stod(range[1]);
        counts.most = std::stod(range[2]);
        counts.zero = std::stoull(range[3]);
        return counts;
    }
    counts.listed = true;
    counts.voxels = pairs(rest.substr(0, rest.find(';')));
    counts.least = counts.voxels.begin()->first;
    counts.most = counts.voxels.rbegin()->first;
    const auto zero = counts.voxels.find(0);
    counts.zero = zero == counts.voxels.end() ? 0 : zero->second;
    return counts;
}

bool Counts::isLabelMap() const
{
    const bool onlyZero = different == 1 && least == 0;
    return different > 0 && different <= 1024 && !nonInteger && nonFinite == 0 && least >= 0 && most <= 65535 && !onlyZero;
}

std::map<int, std::uint64_t> histogram(const LabelImage& image)
{
    std::vector<std::uint64_t> all(65536, 0);
    for (const std::uint16_t v : image.values) {
        ++all[v];
    }
    std::map<int, std::uint64_t> counts;
    for (std::size_t v = 0; v < all.size(); ++v) {
        if (all[v] > 0) {
            counts[static_cast<int>(v)] = all[v];
        }
    }
    return counts;
}

std::map<int, std::uint64_t> segmentVoxels(const Row& row)
{
    // "seg:frames/voxels 1:3/107098, 2:1/11888; SEGMENTS ..."; a LABELMAP's line has its one segment as number 0.
    std::map<int, std::uint64_t> out;
    const std::string list = row.counts.substr(0, row.counts.find(';'));
    const std::regex entry("(\\d+):(\\d+)/(\\d+)");
    for (std::sregex_iterator it(list.begin(), list.end(), entry), end; it != end; ++it) {
        const int number = std::stoi((*it)[1]);
        out[number == 0 ? 1 : number] = std::stoull((*it)[3]);
    }
    return out;
}

Place placeOf(const Row& row)
{
    std::smatch match;
    const std::regex form("origin \\(([^)]*)\\) size .* sp ([-\\d. ]+) dir \\[([^\\]]*)\\]");
    if (!std::regex_search(row.place, match, form)) {
        return {};
    }
    return {true, numbers(match[1]), numbers(match[2]), numbers(match[3])};
}

}  // namespace palpate::volume::manifest
