#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate accuracy`.
void addAccuracy(CLI::App& app);
/// `palpate stability`.
void addStability(CLI::App& app);
/// `palpate validate`: what is simulated beside measurements and closed forms.
void addValidate(CLI::App& app);
/// `palpate bench kernel`.
void addBenchKernel(CLI::App& bench);
/// `palpate bench needle`.
void addBenchNeedle(CLI::App& bench);
/// `palpate bench ipc` and `palpate bench sync`: the thesis's experiments 1 and 2.
void addBenchIpc(CLI::App& bench);
void addBenchSync(CLI::App& bench);
/// `palpate bench tasks`: the thesis's measurement of its tasks, with as many objects as it had and on to a million.
void addBenchTasks(CLI::App& bench);
/// `palpate bench scale`: the largest scene that holds 1 kHz.
void addBenchScale(CLI::App& bench);
/// `palpate bench load`.
void addBenchLoad(CLI::App& bench);
/// `palpate bench view`: how long a viewer takes for a picture of a body that deforms everywhere in every frame.
void addBenchView(CLI::App& bench);

}  // namespace palpate::studies
