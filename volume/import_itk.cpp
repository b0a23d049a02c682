#include <volume/import_source.h>

#include <itkMetaImageIO.h>
#include <itkNrrdImageIO.h>

#include <algorithm>

namespace palpate::volume {

namespace {

itk::ImageIOBase::Pointer makeReader(const Source& source)
{
    itk::Object::SetGlobalWarningDisplay(false);
    itk::ImageIOBase::Pointer io;
    if (source.format == Format::nrrd) {
        io = itk::NrrdImageIO::New();
    } else {
        io = itk::MetaImageIO::New();
    }
    io->SetFileName(source.header.string());
    return io;
}

Component componentOf(const itk::ImageIOBase& io, const std::filesystem::path& file)
{
    using Type = itk::IOComponentEnum;
    switch (io.GetComponentType()) {
        case Type::UCHAR:
            return Component::u8;
        case Type::CHAR:
            return Component::i8;
        case Type::USHORT:
            return Component::u16;
        case Type::SHORT:
            return Component::i16;
        case Type::UINT:
            return Component::u32;
        case Type::INT:
            return Component::i32;
        case Type::ULONG:
        case Type::ULONGLONG:
            return Component::u64;
        case Type::LONG:
        case Type::LONGLONG:
            return Component::i64;
        case Type::FLOAT:
            return Component::f32;
        case Type::DOUBLE:
            return Component::f64;
        default:
            refuse(file, "has a type of voxel that no label map has: save it as unsigned integers");
    }
}

// ITK's descriptions run over many lines and name addresses; one clear line is left.
std::string oneLine(const itk::ExceptionObject& e)
{
    std::string text = e.GetDescription();
    std::replace(text.begin(), text.end(), '\n', ' ');
    const auto start = text.find("): ");
    text = start == std::string::npos ? text : text.substr(start + 3);
    text = text.substr(0, 200);
    text.erase(text.find_last_not_of(" .") + 1);
    return text;
}

template <typename Work>
auto guarded(const Source& source, const Work& work)
{
    try {
        return work();
    } catch (const itk::ExceptionObject& e) {
        refuse(source.header, fmt::format("ITK cannot read it ({}): save it again as NIfTI or NRRD", oneLine(e)));
    }
}

ItkHeader headerOf(const itk::ImageIOBase& io, const std::filesystem::path& file)
{
    if (io.GetNumberOfComponents() != 1) {
        refuse(file, fmt::format("has {} values per voxel; a label map has one", io.GetNumberOfComponents()));
    }
    ItkHeader header;
    header.component = componentOf(io, file);
    const unsigned dimensions = std::min(3U, io.GetNumberOfDimensions());
    header.size = Index3(1);
    for (unsigned axis = 0; axis < dimensions; ++axis) {
        const int a = static_cast<int>(axis);
        const std::vector<double> direction = io.GetDirection(axis);
        header.size[a] = static_cast<int>(io.GetDimensions(axis));
        header.affine.origin[a] = 1e-3 * io.GetOrigin(axis);
        for (unsigned row = 0; row < dimensions; ++row) {
            header.affine.linear[a][static_cast<int>(row)] = 1e-3 * io.GetSpacing(axis) * direction[row];
        }
    }
    return header;
}

}  // namespace

ItkHeader itkHeader(const Source& source)
{
    return guarded(source, [&] {
        const auto io = makeReader(source);
        io->ReadImageInformation();
        return headerOf(*io, source.header);
    });
}

Pixels itkPixels(const Source& source)
{
    return guarded(source, [&] {
        const auto io = makeReader(source);
        io->ReadImageInformation();
        const ItkHeader header = headerOf(*io, source.header);
        itk::ImageIORegion region(io->GetNumberOfDimensions());
        for (unsigned axis = 0; axis < io->GetNumberOfDimensions(); ++axis) {
            region.SetSize(axis, io->GetDimensions(axis));
        }
        io->SetIORegion(region);
        Pixels pixels{header.component, std::vector<std::byte>(source.voxels() * bytesOf(header.component))};
        io->Read(pixels.bytes.data());
        return pixels;
    });
}

}  // namespace palpate::volume
