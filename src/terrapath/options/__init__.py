"""Every option of ``terrapath plan``: name, type, default and help, each said once.

The command line, scenario files, their JSON Schema and what ``terrapath init`` writes are all
made of these declarations. Nothing heavy is imported here: typer reads them to print the
help, pydantic only where a file is read.
"""
