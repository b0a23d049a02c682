#include <studies/transfer/timeline.h>

#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <system_error>

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

ScratchFolder::ScratchFolder()
{
    std::string name = fs::temp_directory_path() / "palpate-bench-XXXXXX";
    if (mkdtemp(name.data()) == nullptr) {
        throw std::runtime_error(name + ": no folder can be made here");
    }
    folder_ = name;
}

ScratchFolder::~ScratchFolder()
{
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
}

}  // namespace palpate::studies
