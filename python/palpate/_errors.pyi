class Error(RuntimeError): ...

class SceneError(Error, ValueError):
    file: str | None
    line: int | None
    key: str | None

def scene_error(message: str) -> SceneError: ...
