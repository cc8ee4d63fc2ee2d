// SPDX-License-Identifier: GPL-3.0-or-later
// Handle-transform files (*.handles) as plain values: what an edit session does
// to a shape, statement by statement. What the statements mean for a model is
// the session's business.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "io/base/error.h"
#include "io/scene/skeleton_file.h"
#include "io/scene/spline_line.h"
#include "octree/base/rigid_move.h"

namespace cellwarp::core
{

/// Frames are numbered from 0 to this.
inline constexpr std::int64_t kLastFrame = 999999999;

enum class Role
{
    Fixed,
    Handle,
    Pin,
    Stiff,
    Rod,   ///< a handle that bends
    Curve, ///< a guide: it carries nothing
    Bone   ///< what moves with one joint of a skeleton
};

/// The word of the file: "fixed", "handle", "pin", "stiff", "rod" or "curve"; "bone".
std::string role_name(Role role);

/// Which samples a region statement names. Numbers are in the file's units.
struct Selector
{
    enum class Kind
    {
        Box,       ///< numbers: x0 y0 z0 x1 y1 z1
        Sphere,    ///< x y z r
        Capsule,   ///< x0 y0 z0 x1 y1 z1 r
        Halfspace, ///< nx ny nz d
        Indices,   ///< ranges
        Labels,    ///< name: file (resolved against the handle file), label
        Group,     ///< name
        All,
        Spline ///< RegionStatement::spline
    };
    Kind kind = Kind::All;
    std::vector<double> numbers;
    std::vector<std::pair<std::int64_t, std::int64_t>> ranges; ///< first and last
    std::string name;
    std::int64_t label = 0;
};

/// What a selector begins with: the words of its kinds, but for the last.
inline constexpr std::array kSelectorWords = {"box",     "sphere", "capsule", "halfspace",
                                              "indices", "labels", "group",   "all"};

/// A rod or a curve at rest. Numbers are in the file's units; a rod has one radius, of
/// the tube that it carries, or none.
struct SplineStatement : SplineLine
{
    std::string
        near; ///< of Form::Skeleton: the region of its limb; empty: the longest one
    std::optional<double> stiffness; ///< the rod pushes back; > 0
    bool is_exact = false;           ///< samples in the tube end where the rod has them

    bool operator==(const SplineStatement&) const = default;
};

/// Most points of a rod or curve, and spans of a gap between two.
inline constexpr std::int64_t kMostSplinePoints = 1000, kMostSpans = 64;

struct RegionStatement
{
    Role role = Role::Fixed;
    std::string name;
    Selector selector;
    double factor = 1.0; ///< of a stiff region; > 0
    std::int64_t line = 0;
    /// Of a rod or curve alone.
    std::shared_ptr<const SplineStatement> spline = {};
};

/// "on PIN GUIDE": the place of a pin stays on a curve or rod.
struct OnStatement
{
    std::string pin, guide;
    std::optional<double> at; ///< share of its rest length; none: it slides
    std::int64_t line = 0;
};

/// One step of a move, applied in the order written.
struct Operation
{
    enum class Kind
    {
        Translate, ///< move.translation
        Rotate,    ///< the rest of move, or is_about_border
        Matrix,    ///< matrix
        To,        ///< vector: where the pin, the point of a rod, or the joint goes
        Turn,      ///< move.degrees, about the tangent of a rod
        Tangent    ///< vector: where the tangent of a rod points
    };
    Kind kind = Kind::Translate;
    RigidMove move =
        {}; ///< without a pivot it turns about the centre of the region's box
    bool is_about_border = false; ///< the centroid of the glue around the region instead
    Eigen::Vector3d vector = Eigen::Vector3d::Zero();
    /// Of Kind::Matrix alone: an edit session holds thousands of the other kinds.
    std::shared_ptr<const Eigen::Matrix4d> matrix;
};

/// What a move or a release is about: a region as a whole, or a point of a rod or curve.
struct MovePlace
{
    enum class Kind
    {
        Whole,
        Point,
        Start,
        End
    };
    Kind kind = Kind::Whole;
    std::int64_t point = 0; ///< of Kind::Point

    auto operator<=>(const MovePlace&) const = default;
};

/// What may be held of a rod at a point.
struct HoldParts
{
    bool place = false, tangent = false, twist = false;

    bool operator==(const HoldParts&) const = default;
};

struct Move
{
    std::string region; ///< or a joint
    std::vector<Operation> operations;
    std::int64_t line = 0;
    MovePlace place = {};
    /// Of a release: what is no longer held; then there are no operations.
    std::optional<HoldParts> released = {};
    /// Of a joint that goes to a place: the first joint of the chain that turns for it;
    /// empty: the one behind the next branch.
    std::string chain = {};
};

struct FrameStatement
{
    std::int64_t number = 0;
    std::vector<Move> moves;
    std::int64_t line = 0;
    std::optional<double> time = {}; ///< of the keys that it stands for [s]
    bool is_asked = true;            ///< false: made to see the shape at rest
};

/// Regions and the frames that move them, up to a commit.
struct Stage
{
    std::vector<RegionStatement> regions;
    std::vector<FrameStatement> frames;
    std::vector<OnStatement> ons = {};
    std::vector<SkeletonJoint> joints = {}; ///< parents first
};

/// Label files, each read once: whoever asks later, from any thread, gets the same.
class LabelFiles
{
public:
    /// Throws what read_labels() throws; then it is read the next time.
    std::shared_ptr<const std::vector<std::int64_t>> read(const std::string& path);

private:
    std::mutex mutex_;
    std::map<std::string, std::shared_ptr<const std::vector<std::int64_t>>> read_;
};

struct HandleFile
{
    /// The save that wrote it, see saved_pair.h: a comment of the file.
    struct Save
    {
        std::string print, scene; ///< name of the scene beside it
    };

    std::string path;
    bool is_relative = false;  ///< "units relative"
    std::vector<Stage> stages; ///< one more than there are commits
    std::optional<Save> save = {};
    /// Those that selectors name; copies share them.
    std::shared_ptr<LabelFiles> labels = std::make_shared<LabelFiles>();
};

/// Throws Fault::File or Fault::Malformed with line and field; also of a skeleton that
/// the file names. \p joints stand before its statements, parents first.
HandleFile read_handles(const std::string& path, std::vector<SkeletonJoint> joints = {});

/// The same for text in memory; without a path it is of no file, and its errors name no
/// other lines than the one that is wrong.
HandleFile parse_handles(const std::string& path, std::string_view text,
                         std::vector<SkeletonJoint> joints = {});

/// A handle file that grows statement by statement. Each is checked as parse_handles()
/// checks it; one that is refused with an Error changes nothing.
class HandleBuilder
{
public:
    HandleBuilder();
    /// With the statements of a file so far: what parse_handles() reads.
    HandleBuilder(const std::string& path, std::string_view text);
    /// To go on behind the statements of a file that was parsed.
    explicit HandleBuilder(HandleFile file);
    HandleBuilder(const HandleBuilder&);
    HandleBuilder& operator=(const HandleBuilder&);
    HandleBuilder(HandleBuilder&&) noexcept;
    HandleBuilder& operator=(HandleBuilder&&) noexcept;
    ~HandleBuilder();

    const HandleFile& file() const;
    void use_relative_units();
    void add(RegionStatement region);
    void add(const OnStatement& on);
    void add(const SkeletonJoint& joint);
    /// Moves that the frame holds already are not taken.
    void add(const FrameStatement& frame);
    /// To the last frame.
    void add(const Move& move);
    void commit();

private:
    class Parser;
    friend HandleFile parse_handles(const std::string& path, std::string_view text,
                                    std::vector<SkeletonJoint> joints);
    HandleBuilder(const std::string& path, std::string_view text,
                  std::vector<SkeletonJoint> joints);
    /// Line by line.
    void parse(const std::string& statements);

    std::unique_ptr<Parser> parser_;
};

/// Whether a handle file can say this name of a region, group or label file: it may hold
/// no line break and no NUL; with a double quote in it, it may neither begin with one nor
/// hold a blank or #.
bool is_handle_name(std::string_view name);

/// The file's text, for \p file.path: parse_handles() gives the same numbers to the bit
/// and the same names. Long lists of indices become several statements of their region;
/// label files are named relative to the folder of the path where they can be. Throws
/// Fault::Usage for a name that is_handle_name() refuses.
/// \pre All else is as parse_handles() accepts it: what must be finite is, each stage but
/// the last has a frame, each move an operation.
std::string handle_text(const HandleFile& file);

/// The regions, ons and frames of a stage, or of a part of it, a line each, and back:
/// what a line says by itself, whatever stands around it. Names of label files are as
/// they are in the values. Throws as handle_text() and parse_handles() do; \p where names
/// the text in errors.
std::string statements_text(const Stage& part);
Stage parse_statements(const std::string& where, std::string_view text);
/// The line of a move or release.
std::string statement_text(const Move& move);

/// The deformation survey's pair as a handle file: labels 0 fixed, 1 free,
/// 2 handle of \p sel, and the one matrix of \p def, as frame 1.
HandleFile read_survey_pair(const std::string& sel, const std::string& def);

/// One integer a sample: a .sel (text, # comments) or a .dmat (libigl).
std::vector<std::int64_t> read_labels(const std::string& path);
std::vector<std::int64_t> parse_labels(const std::string& path, std::string_view bytes);

} // namespace cellwarp::core
