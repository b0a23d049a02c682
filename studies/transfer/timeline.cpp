#include <studies/transfer/timeline.h>

#include <base/error.h>

#include <fstream>

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
    base::failIf(pictures.size() < 2, "a viewer showed no pictures: its message is above");
    return pictures;
}

}  // namespace palpate::studies
