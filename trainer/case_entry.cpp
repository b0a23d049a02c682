#include <trainer/case_entry.h>

#include <algorithm>
#include <array>
#include <utility>

namespace palpate::trainer {

namespace {

CaseEntry biopsy(std::string id, std::string title, int difficulty, std::string trains, std::vector<std::string> arguments,
                 std::string danger)
{
    CaseEntry c;
    c.picture = id + ".png";
    c.id = std::move(id);
    c.title = std::move(title);
    c.difficulty = difficulty;
    c.trains = std::move(trains);
    c.arguments = std::move(arguments);
    c.steps = {"Hold the left mouse button in the picture: you hold the needle. Its tip waits above the skin.",
               "Touch the skin where the planned line begins, and push on until the skin gives way. The wheel moves the "
               "needle along itself, 1 mm a notch.",
               std::move(danger), "Stop with the tip at the near rim of the lesion and fire (Space). The throw is 22 mm.",
               "Draw the needle out, and end the session (E)."};
    return c;
}

CaseEntry palpation()
{
    CaseEntry c;
    c.id = "find-lump";
    c.title = "Find the lump";
    c.picture = "find-lump.png";
    c.difficulty = 2;
    c.trains = "Palpation: where is it harder, and how large is it? Nothing shows the lump.";
    c.arguments = {"--task", "find-lump"};
    c.palpation = true;
    c.steps = {"Hold the left mouse button in the picture: you hold the fingertip.",
               "Press here and there (wheel: deeper). Compare force and depth.",
               "Mark two opposite edges of the hard place (M): their middle is your answer, their distance the size.",
               "End the session (E)."};
    return c;
}

}  // namespace

const char* difficultyInWords(int difficulty) noexcept
{
    constexpr std::array words{"first steps", "easy", "medium", "hard", "very hard"};
    return words[static_cast<std::size_t>(std::clamp(difficulty, 1, 5) - 1)];
}

std::vector<CaseEntry> builtInCases()
{
    const std::string aside = "Advance along the planned line. A step in words above the picture says when you are off it.";
    return {
        biopsy("layered", "Flat layers, one tumour", 1, "Hold the needle, feel skin, fat and gland give way, fire.",
               {"layered"}, aside),
        palpation(),
        biopsy("breast", "Core biopsy of a breast", 2, "The whole procedure in a breast: find the line, keep it, one core.",
               {"breast"}, aside),
        biopsy("near-vessel", "Between artery and vein", 4,
               "Keep a margin: an artery lies beside the tumour, a vein across the way to it.", {"--task", "near-vessel"},
               "Keep off the orange shells around the vessels. Needle and throw must pass both."),
        biopsy("behind-rib", "Behind a rib", 5, "A lesion of the liver behind a rib: go in between two ribs, aslant.",
               {"--task", "behind-rib"},
               "The planned line passes between two ribs. Bone stops the needle: draw back, "
               "do not push.")};
}

}  // namespace palpate::trainer
