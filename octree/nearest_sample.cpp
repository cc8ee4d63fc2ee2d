// SPDX-License-Identifier: GPL-3.0-or-later
// Distances change by no more than the way that one goes. Let r be the distance from the
// middle of a block to its outermost voxel, and d the one from there to the nearest
// sample: a sample of another kind that is farther than d + 2 r from the middle is
// nearest to no voxel of the block. So one label, the nearest sample, decides all 64
// voxels where no other kind comes within 2 r. Labels are found once. For given kinds
// more of them are handed on, from where blocks of different kinds touch and from the
// samples in the blocks themselves, and only as far as 2 r allows: a layer of blocks some
// three thick along the borders. There the voxels are measured to the samples that lie in
// the blocks around, and in those that the labels there come from: first eight voxels at
// once, by the same rule.
#include "octree/nearest_sample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <utility>

namespace cellwarp::core
{

namespace
{

/// Distances are told apart to a step of this [voxel]; of equal ones the first sample
/// counts. So rounding decides nothing where voxels lie just between samples, and is
/// unlikely to elsewhere: no regular grid has its distances on such an odd number.
constexpr double kSame = 7.0710678e-4;

std::uint32_t in_steps(double voxels)
{
    return static_cast<std::uint32_t>(voxels / kSame + 0.5);
}

/// Twice the way from the middle of a block to the middle of a voxel there, the longest
/// one: the outermost voxels of a grid may be thicker than others [kSame].
std::uint32_t twice_reach(const VoxelGrid& grid)
{
    Eigen::Vector3d reach;
    for (int axis = 0; axis < 3; ++axis)
    {
        double off = 0.0; // of the middle of a voxel
        for (int i = grid.inside_box().first[axis]; i <= grid.inside_box().last[axis];
             ++i)
        {
            const Eigen::Vector3i voxel = i * Eigen::Vector3i::Unit(axis);
            off = std::max(off,
                           std::abs(grid.to_voxels(grid.centre(voxel))[axis] - i - 0.5));
        }
        reach[axis] = 0.5 * (MaterialBlocks::kWidth - 1) + off;
    }
    return in_steps(2.0 * reach.norm()) + 2;
}

/// Distances from the middle of a block.
class MiddleOfBlock
{
public:
    MiddleOfBlock(const VoxelGrid& grid, const Eigen::Vector3i& first_voxel)
        : middle_(grid.from_voxels(first_voxel.cast<double>().array() +
                                   0.5 * MaterialBlocks::kWidth)),
          scale_(1.0 / grid.shape().voxel())
    {
    }

    std::uint32_t to(const Eigen::Vector3d& x) const
    {
        return in_steps(scale_ * (x - middle_).norm());
    }

private:
    Eigen::Vector3d middle_;
    double scale_;
};

} // namespace

/// Hands labels on through the parts, nearest first: of each kind one to a part, as far
/// as it may be nearest to a voxel there.
class NearestSamples::Flood
{
public:
    /// \p kinds: of samples; empty: all are of one. \p labels: the first ones are those
    /// of the parts, more are added.
    Flood(const NearestSamples& of, std::span<const std::uint32_t> kinds,
          std::vector<Label>& labels)
        : of_(of), kinds_(kinds), labels_(labels), twice_reach_(twice_reach(of.grid_))
    {
    }

    void offer(std::size_t part, const Label& from)
    {
        if (labels_[part].sample != kNone &&
            from.radius > labels_[part].radius + twice_reach_)
            return;
        Label* label = &labels_[part]; // of the same kind, or the last one
        const auto is_other = [&]
        { return label->sample != kNone && kind(label->sample) != kind(from.sample); };
        while (is_other() && label->next != kNone)
            label = &labels_[label->next];
        const bool is_new = is_other();
        if (!is_new && from.radius > label->radius)
            return;
        const MiddleOfBlock middle(of_.grid_,
                                   of_.parts_.first_voxel(of_.parts_.block(part)));
        const std::uint32_t radius =
            std::max(from.radius, middle.to(of_.samples_[from.sample]));
        if (is_new ? radius > labels_[part].radius + twice_reach_
                   : std::pair(radius, from.sample) >=
                         std::pair(label->radius, label->sample))
            return;
        if (is_new)
        {
            label->next = static_cast<std::uint32_t>(labels_.size());
            label = &labels_.emplace_back();
        }
        *label = {radius, from.sample, from.home, label->next};
        queue_.push({std::uint64_t{radius} << 32 | from.sample,
                     static_cast<std::uint32_t>(part)});
    }

    void run()
    {
        while (!queue_.empty())
        {
            const auto [key, part] = queue_.top();
            queue_.pop();
            const auto sample = static_cast<std::uint32_t>(key);
            std::size_t at = part;
            while (labels_[at].sample != sample && labels_[at].next != kNone)
                at = labels_[at].next;
            const Label label = labels_[at];
            if (label.sample == sample &&
                label.radius == key >> 32) // else one came later
                of_.parts_.for_each_linked(part,
                                           [&](std::size_t next) { offer(next, label); });
        }
    }

private:
    /// Radius and sample as one number, and the part.
    using Entry = std::pair<std::uint64_t, std::uint32_t>;

    std::uint32_t kind(std::uint32_t sample) const
    {
        return kinds_.empty() ? 0 : kinds_[sample];
    }

    const NearestSamples& of_;
    std::span<const std::uint32_t> kinds_;
    std::vector<Label>& labels_;
    std::uint32_t twice_reach_;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

/// Finds the kinds of the voxels of a part that may be nearest to samples of several.
class NearestSamples::MixedPart
{
public:
    MixedPart(const NearestSamples& of, std::span<const std::uint32_t> kinds,
              const std::vector<Label>& labels)
        : of_(of), kinds_(kinds), labels_(labels), twice_reach_(twice_reach(of.grid_))
    {
    }

    /// The voxels of \p part by kinds.
    const std::vector<std::pair<std::uint32_t, std::uint64_t>>& settle(std::size_t part)
    {
        find_candidates(part);
        found_.clear();
        for (int z = 0; z < MaterialBlocks::kWidth; z += 2)
            for (int y = 0; y < MaterialBlocks::kWidth; y += 2)
                for (int x = 0; x < MaterialBlocks::kWidth; x += 2)
                    settle_octant(part, {x, y, z});
        return found_;
    }

private:
    /// The parts around, as far as these hold together within the blocks that touch.
    void find_near_parts(std::size_t part)
    {
        const Eigen::Vector3i here = of_.parts_.first_voxel(of_.parts_.block(part));
        near_.assign(1, part);
        for (std::size_t next = 0; next < near_.size(); ++next)
            of_.parts_.for_each_linked(
                near_[next],
                [&](std::size_t other)
                {
                    if (std::find(near_.begin(), near_.end(), other) != near_.end())
                        return;
                    const Eigen::Vector3i away =
                        of_.parts_.first_voxel(of_.parts_.block(other)) - here;
                    if (away.cwiseAbs().maxCoeff() <= MaterialBlocks::kWidth)
                        near_.push_back(other);
                });
    }

    /// The samples that lie in the parts around, and in those that their labels come
    /// from.
    void find_candidates(std::size_t part)
    {
        find_near_parts(part);
        homes_.assign(near_.begin(), near_.end());
        for (const std::size_t near : near_)
            for (std::size_t at = near; at != kNone; at = labels_[at].next)
                if (labels_[at].sample != kNone)
                    homes_.push_back(labels_[at].home);
        std::sort(homes_.begin(), homes_.end());
        homes_.erase(std::unique(homes_.begin(), homes_.end()), homes_.end());
        const MiddleOfBlock middle(of_.grid_,
                                   of_.parts_.first_voxel(of_.parts_.block(part)));
        measured_.clear();
        std::uint32_t least = kNone - twice_reach_;
        for (const std::size_t home : homes_)
            for (const std::uint32_t sample : of_.own_samples(home))
            {
                const std::uint32_t d = middle.to(of_.samples_[sample]);
                least = std::min(least, d);
                measured_.emplace_back(sample, d);
            }
        std::erase_if(measured_,
                      [&](const auto& of) { return of.second > least + twice_reach_; });
        std::sort(measured_.begin(), measured_.end());
        const auto end = std::unique(measured_.begin(), measured_.end());
        middle_ = of_.parts_.first_voxel(of_.parts_.block(part)).cast<double>().array() +
                  0.5 * MaterialBlocks::kWidth;
        candidates_.clear();
        for (auto of = measured_.begin(); of != end; ++of)
            candidates_.add(in_voxels(of_.samples_[of->first]), kinds_[of->first]);
    }

    /// Eight voxels at once, where no other kind comes near; else one by one.
    void settle_octant(std::size_t part, const Eigen::Vector3i& corner)
    {
        constexpr std::uint64_t kOctant = 0x330033;
        const std::uint64_t voxels =
            of_.parts_.voxels(part) & kOctant << bit_of_place(corner);
        if (voxels == 0)
            return;
        const VoxelGrid& grid = of_.grid_;
        const Eigen::Vector3i block = of_.parts_.first_voxel(of_.parts_.block(part));
        const Eigen::Vector3i first = block + corner;
        const Eigen::Vector3d low = in_voxels(grid.centre(first));
        const Eigen::Vector3d high = in_voxels(
            grid.centre((first.array() + 1).min(grid.counts().array() - 1).matrix()));
        const float least = candidates_.measure(0.5 * (low + high), distances_);
        const float most = static_cast<float>(std::sqrt(double{least}) +
                                              (high - low).norm() + 2.0 * kSame);
        near_candidates_.clear();
        bool has_others = false;
        for (std::size_t k = 0; k < candidates_.kinds.size(); ++k)
            if (distances_[k] <= most * most)
            {
                near_candidates_.add(candidates_, k);
                has_others |= candidates_.kinds[k] != near_candidates_.kinds.front();
            }
        if (!has_others)
            return add(near_candidates_.kinds.front(), voxels);
        for_each_bit(
            voxels,
            [&](int bit)
            {
                add(kind_nearest_to(in_voxels(grid.centre(block + place_of_bit(bit)))),
                    std::uint64_t{1} << bit);
            });
    }

    /// From the middle of the block [voxel].
    Eigen::Vector3d in_voxels(const Eigen::Vector3d& x) const
    {
        return of_.grid_.to_voxels(x) - middle_;
    }

    void add(std::uint32_t kind, std::uint64_t voxels)
    {
        for (auto& [known, of_known] : found_)
            if (known == kind)
            {
                of_known |= voxels;
                return;
            }
        found_.emplace_back(kind, voxels);
    }

    /// The first sample counts where several are equally near.
    std::uint32_t kind_nearest_to(const Eigen::Vector3d& x)
    {
        const float least = near_candidates_.measure(x, distances_);
        const double most = (in_steps(std::sqrt(double{least})) + 0.5) * kSame;
        std::size_t k = 0;
        while (distances_[k] > least && !(double{distances_[k]} < most * most))
            ++k;
        return near_candidates_.kinds[k];
    }

    /// Samples, the first ones first: from the middle of the block [voxel], and their
    /// kinds. Rounded they are off by far less than kSame.
    struct Candidates
    {
        std::array<std::vector<float>, 3> places;
        std::vector<std::uint32_t> kinds;

        void clear()
        {
            for (std::vector<float>& along : places)
                along.clear();
            kinds.clear();
        }
        void add(const Eigen::Vector3d& x, std::uint32_t kind)
        {
            for (int axis = 0; axis < 3; ++axis)
                places[idx(axis)].push_back(static_cast<float>(x[axis]));
            kinds.push_back(kind);
        }
        void add(const Candidates& other, std::size_t k)
        {
            for (std::size_t axis = 0; axis < 3; ++axis)
                places[axis].push_back(other.places[axis][k]);
            kinds.push_back(other.kinds[k]);
        }
        /// Their distances from a place, squared. Returns the least.
        float measure(const Eigen::Vector3d& x, std::vector<float>& distances) const
        {
            using Array = Eigen::Map<const Eigen::ArrayXf>;
            const auto count = static_cast<Eigen::Index>(kinds.size());
            const Eigen::Vector3f p = x.cast<float>();
            distances.resize(kinds.size());
            Eigen::Map<Eigen::ArrayXf> squares(distances.data(), count);
            squares = (Array(places[0].data(), count) - p.x()).square() +
                      (Array(places[1].data(), count) - p.y()).square() +
                      (Array(places[2].data(), count) - p.z()).square();
            return squares.minCoeff();
        }
    };

    const NearestSamples& of_;
    std::span<const std::uint32_t> kinds_;
    const std::vector<Label>& labels_;
    std::uint32_t twice_reach_;
    std::vector<std::pair<std::uint32_t, std::uint64_t>> found_; ///< kind, voxels
    std::vector<std::size_t> near_, homes_;                      ///< parts
    std::vector<std::pair<std::uint32_t, std::uint32_t>> measured_;
    Eigen::Vector3d middle_; ///< of the block [voxel]
    Candidates candidates_, near_candidates_;
    std::vector<float> distances_; ///< of either
};

NearestSamples::NearestSamples(const VoxelGrid& grid,
                               std::span<const Eigen::Vector3d> samples,
                               std::span<const std::size_t> voxel_of_sample,
                               const Notches& notches)
    : grid_(grid), samples_(samples), parts_(grid, notches), nearest_(parts_.size())
{
    find_own_samples(voxel_of_sample);
    Flood flood(*this, {}, nearest_);
    for (std::size_t part = 0; part < parts_.size(); ++part)
        for (const std::uint32_t sample : own_samples(part))
            flood.offer(part, {0, sample, static_cast<std::uint32_t>(part)});
    flood.run();
}

void NearestSamples::find_own_samples(std::span<const std::size_t> voxel_of_sample)
{
    const VoxelFlags& material = grid_.material();
    std::vector<std::pair<std::uint32_t, std::uint32_t>> own; // part, sample
    for (std::size_t i = 0; i < samples_.size(); ++i)
    {
        const std::size_t before = own.size();
        const auto add = [&](const Eigen::Vector3i& voxel)
        {
            const std::pair<std::uint32_t, std::uint32_t> entry(parts_.part_of(voxel), i);
            if (std::find(own.begin() + static_cast<std::ptrdiff_t>(before), own.end(),
                          entry) == own.end())
                own.push_back(entry);
        };
        for_each_voxel(grid_.touched(samples_[i]),
                       [&](const Eigen::Vector3i& voxel)
                       {
                           const std::uint8_t there = material[grid_.index(voxel)];
                           if (there != 0 && (voxel_of_sample.empty() ||
                                              there == material[voxel_of_sample[i]]))
                               add(voxel);
                       });
        if (own.size() == before && !voxel_of_sample.empty())
            add(grid_.coordinates(voxel_of_sample[i]));
    }
    std::sort(own.begin(), own.end());
    first_own_.reserve(parts_.size() + 1);
    own_.reserve(own.size());
    for (const auto& [part, sample] : own)
    {
        first_own_.resize(part + 1, static_cast<std::uint32_t>(own_.size()));
        own_.push_back(sample);
    }
    first_own_.resize(parts_.size() + 1, static_cast<std::uint32_t>(own_.size()));
}

std::vector<VoxelRuns> NearestSamples::voxels_of(std::span<const std::uint32_t> kinds,
                                                 std::size_t num_kinds) const
{
    std::vector<Label> labels = nearest_;
    Flood flood(*this, kinds, labels);
    for (std::size_t part = 0; part < parts_.size(); ++part)
    {
        const Label& label = nearest_[part];
        if (label.sample == kNone)
            continue;
        for (const std::uint32_t sample : own_samples(part))
            if (kinds[sample] != kinds[label.sample])
                flood.offer(part, {0, sample, static_cast<std::uint32_t>(part)});
        parts_.for_each_linked(part,
                               [&](std::size_t other)
                               {
                                   if (kinds[nearest_[other].sample] !=
                                       kinds[label.sample])
                                       flood.offer(other, label);
                               });
    }
    flood.run();
    std::vector<std::vector<MaterialBlocks::Bits>> blocks(num_kinds);
    MixedPart mixed(*this, kinds, labels);
    for (std::size_t part = 0; part < parts_.size(); ++part)
    {
        const auto add = [&](std::uint32_t kind, std::uint64_t voxels)
        {
            if (kind != 0)
                blocks[kind].push_back({parts_.block(part), voxels});
        };
        if (labels[part].next != kNone)
            for (const auto& [kind, voxels] : mixed.settle(part))
                add(kind, voxels);
        else if (labels[part].sample != kNone)
            add(kinds[labels[part].sample], parts_.voxels(part));
    }
    std::vector<VoxelRuns> voxels(num_kinds);
    for (std::size_t kind = 1; kind < num_kinds; ++kind)
        voxels[kind] = parts_.runs_of(blocks[kind]);
    return voxels;
}

} // namespace cellwarp::core
