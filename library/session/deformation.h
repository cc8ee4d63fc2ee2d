// SPDX-License-Identifier: GPL-3.0-or-later
// A deformation apart from the session that made it: from a field file, for any points of
// the same space.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/formats/field_file.h"
#include "library/session/apply_field.h"
#include "library/session/cell_system.h"
#include "solver/field/field.h"

namespace cellwarp::core
{

/// What is kept of a system and its field: all that moves a point.
StoredField stored_field(const CellSystem& system, const Field& field);

/// Where the model of a stored field was, and its axes.
WorkFrame frame_of(const StoredField& stored);

/// What a Deformation of that file takes at the most, the file's own numbers included,
/// but not what it keeps meanwhile [byte].
double memory_of(const FieldFile& file);

/// Maps that follow each other, one for each commit and the last. Immutable, but for what
/// they keep of what they looked up.
class Deformation
{
public:
    /// \p path names the file, for messages. Throws Fault::Malformed if its parts do not
    /// fit together, and Fault::Budget, before anything large is made, if memory_of() is
    /// over \p max_memory [byte] (0: no limit).
    Deformation(const FieldFile& file, const std::string& path, double max_memory = 0.0);
    ~Deformation();
    Deformation(Deformation&&) noexcept;
    Deformation& operator=(Deformation&&) noexcept;

    std::size_t num_maps() const { return maps_.size(); }
    /// What it may come to keep while it moves places, beyond memory_of() [byte].
    double most_kept() const { return most_kept_; }
    std::uint32_t checksum() const { return checksum_; } ///< of the file

    /// How many places lie farther outside the box of the first map's model than a
    /// twentieth of its diagonal: no material near tells where they go.
    std::uint64_t num_outside(std::span<const Eigen::Vector3d> places) const;

    /// Moves the places and turns what hangs on them, on all threads. What a place
    /// becomes depends on it alone, to the bit: a sample of the session's model gets what
    /// the session gave it. After an exception what was given is unspecified.
    void carry(const Carried& carried) const;

private:
    struct Map;
    std::vector<std::unique_ptr<const Map>> maps_;
    double most_kept_ = 0.0;
    std::uint32_t checksum_ = 0;
};

} // namespace cellwarp::core
