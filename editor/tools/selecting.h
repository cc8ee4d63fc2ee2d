// SPDX-License-Identifier: GPL-3.0-or-later
// Choosing samples with the pointer: by a box, a lasso or a brush on the screen.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "editor/document/selection.h"
#include "editor/tools/camera.h"
#include "editor/tools/picker.h"
#include "library/session/shape.h"

namespace cellwarp::core
{

/// A gesture under way. The view stays as it was when it began; what lies outside it
/// cannot be chosen.
class SelectGesture
{
public:
    enum class Kind
    {
        Box,
        Lasso, ///< what it goes round twice is left out
        Brush  ///< of a radius, along the pointer's way
    };
    struct Options
    {
        Kind kind = Kind::Box;
        bool is_through = false; ///< also what is hidden
        double radius = 20.0;    ///< of a brush [pixel]
    };

    /// A brush paints on the shape as it is now.
    SelectGesture(const Options& options, const Camera& camera, const ShownShape& shape,
                  const Eigen::Vector2d& pixel);

    Kind kind() const { return options_.kind; }
    void move_to(const Eigen::Vector2d& pixel);
    /// What there is of it to draw, closed [pixel].
    std::vector<Eigen::Vector2d> outline() const;
    /// Collects the samples of the area so far; a brush those that it came over since the
    /// last time.
    void collect(const ShownShape& shape);
    /// Chooses those of the collected ones that are seen. That takes a while where they
    /// are many: after \p at_most of them it leaves off. True: none is left.
    bool look(const Picker& picker, std::size_t at_most);
    const Selection& chosen() const { return chosen_; }
    /// Samples of the area that were looked at and could not be seen.
    std::size_t num_hidden() const { return num_hidden_; }

private:
    void mark_stroke(std::vector<std::uint8_t>& marks);

    Options options_;
    Camera camera_;
    std::vector<Eigen::Vector2d> path_;

    std::vector<std::uint32_t> open_; ///< collected, not yet looked at
    Selection chosen_;
    std::size_t num_hidden_ = 0;

    // Of a brush.
    std::shared_ptr<const ShapeLayout> layout_;
    std::vector<Eigen::Vector2f> pixels_; ///< of each place
    std::size_t painted_ = 0;             ///< points of the path that are done
    Selection collected_;
};

} // namespace cellwarp::core
