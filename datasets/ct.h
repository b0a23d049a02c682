#pragma once

namespace palpate::datasets {

/// CT guidance of a scene: what one scan is. It is taken on demand, and its dose is counted.
struct CtSpec {
    int slices = 0;        // side by side, the middle one through the tool's tip; 0: the scene has no CT
    double width = 5e-3;   // of a slice [m]
    double doseIndex = 5;  // CTDIvol of a scan [mGy]

    bool given() const noexcept { return slices > 0; }
    /// Dose-length product of one scan [mGy cm].
    double doseLength() const noexcept { return doseIndex * slices * width * 100.0; }
};

}  // namespace palpate::datasets
