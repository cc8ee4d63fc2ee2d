// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp-import: the library on a file, in a process of its own that begins afresh. On
// a malformed file it may crash, hang or take all memory; then only this process ends,
// and it ends with the one that has started it.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "io/base/descriptor.h"
#include "io/import/imported.h"

namespace
{

using namespace cellwarp::core;

constexpr rlim_t kMaxSeconds = 300;
constexpr std::uint64_t kMaxNesting = 1000;
/// Samples that instances of meshes may come to.
constexpr std::uint64_t kMaxSamples = 100000000;

/// Opens nothing: the bytes are all there is.
class NoFiles : public Assimp::IOSystem
{
public:
    bool Exists(const char*) const override { return false; }
    char getOsSeparator() const override { return '/'; }
    Assimp::IOStream* Open(const char*, const char*) override { return nullptr; }
    void Close(Assimp::IOStream*) override {}
};

Eigen::Affine3d affine(const aiMatrix4x4& matrix)
{
    Eigen::Affine3d map = Eigen::Affine3d::Identity();
    for (unsigned row = 0; row < 3; ++row)
        for (unsigned column = 0; column < 4; ++column)
            map(row, column) = static_cast<double>(matrix[row][column]);
    return map;
}

Eigen::Vector3d vector(const aiVector3D& v)
{
    return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

/// One mesh under one node; false if it cannot be trusted.
bool add_mesh(const aiMesh& mesh, const Eigen::Affine3d& to_world, Imported& out)
{
    const std::size_t first = out.samples.size();
    if (mesh.mNumVertices > kMaxSamples - first)
    {
        out.problem = "more than 100000000 samples";
        return false;
    }
    const Eigen::FullPivLU<Eigen::Matrix3d> linear(to_world.linear());
    const Eigen::Matrix3d of_normals = linear.isInvertible()
                                           ? Eigen::Matrix3d(linear.inverse().transpose())
                                           : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
    for (unsigned i = 0; i < mesh.mNumVertices; ++i)
    {
        const Eigen::Vector3d x = to_world * vector(mesh.mVertices[i]);
        if (!x.allFinite())
        {
            out.problem =
                "vertex " + std::to_string(out.samples.size()) + ": is not finite";
            return false;
        }
        if (mesh.HasNormals())
        {
            const Eigen::Vector3d normal = of_normals * vector(mesh.mNormals[i]);
            if (normal.allFinite() && normal.norm() > 0)
            {
                out.directions.push_back(normal.normalized());
                out.direction_samples.push_back(
                    static_cast<std::uint32_t>(out.samples.size()));
            }
        }
        out.samples.push_back(x);
    }
    for (unsigned f = 0; f < mesh.mNumFaces; ++f)
    {
        const aiFace& face = mesh.mFaces[f];
        for (unsigned k = 0; k < face.mNumIndices; ++k)
            if (face.mIndices[k] >= mesh.mNumVertices)
            {
                out.problem = "face " + std::to_string(f) +
                              ": its index is out of range (got " +
                              std::to_string(face.mIndices[k]) + ")";
                return false;
            }
        if (face.mNumIndices < 3)
            continue; // a point or a line
        for (unsigned k = 0; k < face.mNumIndices; ++k)
            out.corners.push_back(static_cast<std::uint32_t>(first + face.mIndices[k]));
        out.face_ends.push_back(out.corners.size());
    }
    return true;
}

/// The unit of the file [m]. Most formats, as glTF, count in metres; FBX counts in
/// centimetres, or in as many of them as it says.
double metres(const aiScene& scene, const std::string& extension)
{
    if (extension != "fbx")
        return 1.0;
    double centimetres = 1.0;
    float single = 1.0f;
    if (scene.mMetaData && scene.mMetaData->Get("UnitScaleFactor", single))
        centimetres = static_cast<double>(single);
    else if (scene.mMetaData)
        scene.mMetaData->Get("UnitScaleFactor", centimetres);
    return centimetres > 0.0 && std::isfinite(centimetres) ? 0.01 * centimetres : 0.01;
}

void add_scene(const aiScene& scene, double unit, Imported& out)
{
    struct Visit
    {
        const aiNode* node;
        std::uint64_t depth;
        Eigen::Affine3d to_world;
    };
    std::vector<Visit> rest = {
        {scene.mRootNode, 1,
         Eigen::Scaling(unit) * affine(scene.mRootNode->mTransformation)}};
    while (!rest.empty())
    {
        const Visit visit = rest.back();
        rest.pop_back();
        if (visit.depth > kMaxNesting)
        {
            out.problem = "nodes are nested deeper than 1000";
            return;
        }
        for (unsigned m = 0; m < visit.node->mNumMeshes; ++m)
            if (visit.node->mMeshes[m] >= scene.mNumMeshes ||
                !add_mesh(*scene.mMeshes[visit.node->mMeshes[m]], visit.to_world, out))
                return;
        for (unsigned c = visit.node->mNumChildren; c-- > 0;)
        {
            const aiNode* child = visit.node->mChildren[c];
            rest.push_back({child, visit.depth + 1,
                            visit.to_world * affine(child->mTransformation)});
        }
    }
}

/// Vertices that agree in place and normal become one, so that closed meshes stay
/// closed; what else would tell them apart is dropped first.
Imported imported(const std::string& bytes, const std::string& extension)
{
    Imported out;
    Assimp::Importer importer;
    importer.SetIOHandler(new NoFiles); // it takes it over
    importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                                aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                                    aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS |
                                    aiComponent_ANIMATIONS | aiComponent_TEXTURES |
                                    aiComponent_LIGHTS | aiComponent_CAMERAS);
    const aiScene* scene = importer.ReadFileFromMemory(
        bytes.data(), bytes.size(),
        aiProcess_RemoveComponent | aiProcess_JoinIdenticalVertices, extension.c_str());
    if (!scene || !scene->mRootNode)
        out.problem = "cannot be imported: " + std::string(importer.GetErrorString());
    else
        add_scene(*scene, metres(*scene, extension), out);
    if (out.problem.empty() && out.samples.empty())
        out.problem = "no vertices";
    return out;
}

void limit(__rlimit_resource resource, rlim_t value)
{
    struct rlimit now;
    ::getrlimit(resource, &now);
    now.rlim_cur = std::min(value, now.rlim_max);
    ::setrlimit(resource, &now);
}

/// Of this process alone.
void set_limits()
{
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_CPU, kMaxSeconds);
#ifndef CELLWARP_SANITIZED
    // A sanitizer needs terabytes of address space.
    struct stat input
    {
    };
    const rlim_t size =
        ::fstat(0, &input) == 0 ? static_cast<rlim_t>(input.st_size) : rlim_t(0);
    limit(RLIMIT_AS, (rlim_t(4) << 30) + 64 * size);
#endif
}

/// Ends with \p starter from here on; false if that is gone already.
bool ends_with(std::string_view starter)
{
    std::int64_t process = 0;
    std::from_chars(starter.data(), starter.data() + starter.size(), process);
    return ::prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && ::getppid() == process;
}

bool read_all(std::string& bytes)
{
    for (;;)
    {
        constexpr std::size_t kPart = std::size_t(1) << 20;
        const std::size_t done = bytes.size();
        bytes.resize(done + kPart);
        const std::int64_t got = read_next(0, bytes.data() + done, kPart);
        bytes.resize(done + static_cast<std::size_t>(std::max<std::int64_t>(got, 0)));
        if (got <= 0)
            return got == 0;
    }
}

} // namespace

int main(int argc, char** argv)
{
    if (argc != 3 || !ends_with(argv[2]))
        return 2;
    set_limits();
    // What the library says is no part of the result.
    const int out = ::dup(1);
    const int nothing = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    ::dup2(nothing, 1);
    ::dup2(nothing, 2);
    try
    {
        std::string bytes;
        return read_all(bytes) && write_all(out, imported_bytes(imported(bytes, argv[1])))
                   ? 0
                   : 1;
    }
    catch (...)
    {
        return 1;
    }
}
