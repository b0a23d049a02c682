#include <studies/transfer/timeline.h>

#include <fstream>
#include <stdexcept>

namespace palpate::studies {

namespace fs = std::filesystem;

std::vector<TimelinePicture> readTimeline(const fs::path& file)
{
    std::ifstream in(file);
    std::string head;
    std::getline(in, head);
    std::vector<TimelinePicture> pictures;
    char comma = 0;
    for (TimelinePicture p; in >> p.tick >> comma >> p.published >> comma >> p.read >> comma >> p.done;) {
        pictures.push_back(p);
    }
    if (pictures.size() < 2) {
        throw std::runtime_error("a viewer showed no pictures: its message is above");
    }
    return pictures;
}

}  // namespace palpate::studies
