// SPDX-License-Identifier: GPL-3.0-or-later
// The normals of an OBJ that is larger than the memory. A vn turns as the vertices need
// whose faces use it, and is split where they disagree, so all of the file must be known
// before any of it is written.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "io/base/spill.h"
#include "io/formats/part_reader.h"
#include "io/formats/stream.h"

namespace cellwarp::core
{

/// Whether faces of the file may use normals. A quick look: never no where they do.
/// Leaves \p file at its beginning.
bool may_use_normals(InputFile& file);

/// What becomes of every vn and of every face corner's normal index.
class NormalPlan
{
public:
    /// Reads \p file from its beginning to its end; what grows with it goes to
    /// temporary files in \p folder.
    NormalPlan(InputFile& file, const std::string& path, const std::string& folder,
               const StreamOptions& options, const StreamWork& work);

    /// What the next part, in the file's order, ends with. Replaces the vectors.
    void take(const Geometry& part, std::vector<Eigen::Vector3d>& directions,
              std::vector<IndexEdit>& indices);
    std::size_t num_split() const { return num_split_; }
    /// Writes the statements to be appended to the file.
    void write_lines(OutputFile& output, std::uint64_t& bytes) const;

private:
    /// A corner's use of a vn.
    struct Use
    {
        std::uint32_t direction, sample;
        std::uint64_t corner; ///< counts the corners that have a normal
        bool operator<(const Use& other) const;
    };
    /// A use that occurs once for all corners that share it, waiting for its place.
    struct Waiting
    {
        std::uint32_t sample;
        std::uint64_t use;
        bool operator<(const Waiting& other) const { return sample < other.sample; }
    };
    struct Placed
    {
        std::uint64_t use;
        double place[3]; ///< [model unit] at rest
        bool operator<(const Placed& other) const { return use < other.use; }
    };
    struct NewIndex
    {
        std::uint64_t corner;
        std::uint32_t index;
        bool operator<(const NewIndex& other) const { return corner < other.corner; }
    };
    struct Vector
    {
        double x[3];
    };
    struct Read;

    void read(InputFile& file, const std::string& path, const StreamOptions& options,
              const StreamWork& work, Read& found);
    void turn(Read& found, const std::string& folder, const StreamOptions& options,
              const StreamWork& work);

    SpillList<Vector> directions_; ///< as they end
    SpillSorter<NewIndex> new_indices_;
    SpillFile lines_;
    std::size_t num_split_ = 0;
    std::unique_ptr<SpillReader<Vector>> next_direction_;
    std::unique_ptr<SpillSorter<NewIndex>::Sorted> next_index_;
    std::uint64_t corners_ = 0; ///< that were taken
    NewIndex index_ = {};       ///< the next one
    bool has_index_ = false;
};

} // namespace cellwarp::core
