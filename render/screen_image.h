#pragma once

#include <vtkActor2D.h>
#include <vtkImageData.h>
#include <vtkImageMapper.h>
#include <vtkNew.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>
#include <vtkWindowToImageFilter.h>

namespace palpate::render {

/// Puts an image of bytes on the screen as it is, pixel by pixel, behind the texts. Hidden at first.
inline void addScreenImage(vtkRenderer& renderer, vtkImageData* image, vtkActor2D* actor)
{
    vtkNew<vtkImageMapper> mapper;
    mapper->SetInputData(image);
    mapper->SetColorWindow(255);
    mapper->SetColorLevel(127.5);
    actor->SetMapper(mapper);
    actor->SetLayerNumber(0);
    actor->SetVisibility(0);
    renderer.AddActor2D(actor);
}

/// The picture that a window has drawn last, as the input of what writes it.
inline vtkSmartPointer<vtkWindowToImageFilter> grabbed(vtkRenderWindow& window)
{
    const auto grab = vtkSmartPointer<vtkWindowToImageFilter>::New();
    grab->SetInput(&window);
    grab->SetInputBufferTypeToRGB();
    grab->ReadFrontBufferOff();
    grab->ShouldRerenderOff();
    return grab;
}

}  // namespace palpate::render
